"""Slow, obvious oracles of the refinement of weak lists."""

from fractions import Fraction

from tests.reference import hamming, scores


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


# --- words: the second nearest from another place, and purge ----------------------------------------------------------


class Words:
    """The vocabulary by loops: every word with its birth, its postings and whether it was dropped."""

    def __init__(self, ratio, second, purge):
        self.ratio, self.second, self.purge = ratio, second, purge
        self.words, self.births, self.seen, self.dropped = [], [], [], set()
        self.images = 0

    def match(self, descriptor):
        near = sorted((hamming(descriptor, w), i) for i, w in enumerate(self.words) if i not in self.dropped)
        if not near:
            return -1
        rivals = near[1:]
        if self.second == "other_place":
            rivals = [(d, i) for d, i in near if abs(self.births[i] - self.births[near[0][1]]) > 3] or rivals
        return near[0][1] if rivals and near[0][0] <= self.ratio * rivals[0][0] else -1

    def learn(self, descriptors):
        posted = [self.match(descriptor) for descriptor in descriptors]
        born = {}
        for i, descriptor in enumerate(map(bytes, descriptors)):
            if posted[i] < 0:
                if descriptor not in born:
                    born[descriptor] = len(self.words)
                    self.words.append(descriptor)
                    self.births.append(self.images)
                    self.seen.append(0)
                posted[i] = born[descriptor]
        for word in posted:
            self.seen[word] += 1
        if self.purge:
            self.dropped |= {i for i, b in enumerate(self.births) if b == self.images - 2 and self.seen[i] < 2}
        self.images += 1
        return posted


# --- documents --------------------------------------------------------------------------------------------------------


def document_scores(map_words, map_inside, query_words, inside, one):
    """The score of each map image by its best OBB: every OBB with a keypoint is a document."""
    documents, owner = [], []
    for m, (words, boxes) in enumerate(zip(map_words, map_inside, strict=True)):
        for box in boxes:
            if any(box):
                documents.append([w for w, kept in zip(words, box, strict=True) if kept])
                owner.append(m)
    found = scores(documents, query_words, inside, "ibow", one)
    return [
        [max((row[d] for d, o in enumerate(owner) if o == m), default=0) for m in range(len(map_words))]
        for row in found
    ]


# --- geometric verification -------------------------------------------------------------------------------------------


def one_to_one(query, other):
    """(query keypoint, other keypoint) by the ratio test; of several that want the same one the nearest, then first."""
    wanted = []
    for i, descriptor in enumerate(query.descriptors):
        near = sorted((hamming(descriptor, d), k) for k, d in enumerate(other.descriptors))
        if len(near) > 1 and near[0][0] <= 0.8 * near[1][0]:
            wanted.append((near[0][0], i, near[0][1]))
    taken, pairs = set(), []
    for _, i, k in sorted(wanted):
        if k not in taken:
            taken.add(k)
            pairs.append((i, k))
    return sorted(pairs)


def verified_order(levels, first, inliers):
    """Map ids of one list, ties together: those among ``first`` with inliers by inliers and level, then the rest."""
    grade = {m: (1, inliers[m], s) if m in first and inliers[m] > 0 else (0, s, 0) for m, s in enumerate(levels)}
    return [{m for m in grade if grade[m] == value} for value in sorted(set(grade.values()), reverse=True)]
