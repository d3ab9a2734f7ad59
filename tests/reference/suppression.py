"""Non-maximum suppression as the loop says it."""


def iou(a, b):
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    if width <= 0 or height <= 0:
        return 0.0
    common = width * height
    return common / ((a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - common)


def suppressed(xyxy, score, label, overlap):
    """Return the numbers of the boxes that are kept, best first."""
    kept = []
    for i in sorted(range(len(score)), key=lambda i: (-score[i], i)):
        if all(label[j] != label[i] or iou(xyxy[i], xyxy[j]) <= overlap for j in kept):
            kept.append(i)
    return kept
