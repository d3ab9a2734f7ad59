import threading
import time

from fdslam.bow.gate import Gate


def run(*works):
    threads = [threading.Thread(target=work) for work in works]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(10)
    assert not any(thread.is_alive() for thread in threads)


def test_readers_go_in_together_and_writers_alone():
    gate, together = Gate(), threading.Barrier(3, timeout=10)
    inside, worst = [], []

    def read():
        with gate.reading():
            together.wait()  # all three are in at once, or this fails

    def write():
        with gate.writing():
            inside.append(1)
            worst.append(len(inside))
            time.sleep(0.01)
            inside.pop()

    run(read, read, read)
    assert not together.broken
    run(*[write] * 5)
    assert worst == [1] * 5


def test_a_reader_never_sees_half_a_change():
    gate, state, seen = Gate(), [0, 0], []

    def write():
        for _ in range(200):
            with gate.writing():
                state[0] += 1
                time.sleep(0)
                state[1] += 1

    def read():
        for _ in range(200):
            with gate.reading():
                seen.append(state[0] == state[1])

    run(write, read, read, write)
    assert len(seen) == 400
    assert all(seen)
    assert state == [400, 400]


def test_an_error_inside_opens_the_gate_again():
    gate = Gate()
    for way in (gate.reading, gate.writing):
        try:
            with way():
                raise KeyError
        except KeyError:
            pass
    entered = []

    def enter():
        with gate.writing():
            entered.append("writer")
        with gate.reading():
            entered.append("reader")

    run(enter)
    assert entered == ["writer", "reader"]
