"""Slow, obvious oracles of the refinement of weak lists."""

from fractions import Fraction


def island_order(row, rule):
    """For every image a key by which a list is sorted after islands, smaller is better; None: never retrieved."""
    low, high = min(row), max(row)
    if low == high:
        return [(-s,) if s else None for s in row]
    share = [Fraction(s - low, high - low) for s in row]
    kept = [m for m in range(len(row)) if share[m] > Fraction(3, 10)]
    found = []  # (set of ids that belong to it, members)
    if rule == "ibow":
        for m in sorted(kept, key=lambda m: (-row[m], m)):
            for ground, members in found:
                if m in ground:
                    members.append(m)
                    break
            else:
                ground = {m}
                for step in (-1, 1):
                    for away in (1, 2, 3):
                        n = m + step * away
                        if not 0 <= n < len(row) or any(n in other for other, _ in found):
                            break
                        ground.add(n)
                found.append((ground, [m]))
        score = {m: sum(share[n] for n in members) / len(ground) for ground, members in found for m in members}
    else:
        for m in kept:
            if any(m - members[-1] < 3 for _, members in found):
                found[-1][1].append(m)
            else:
                found.append((set(), [m]))
        score = {m: sum(share[n] for n in members) for _, members in found for m in members}
    return [(0, -score[m], -row[m]) if m in score else ((1, -row[m]) if row[m] else None) for m in range(len(row))]
