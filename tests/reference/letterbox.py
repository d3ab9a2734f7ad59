"""A letterbox pixel by pixel, and the sizes as the published scripts compute them, in floats."""

import numpy as np


def sizes(height, width, canvas_height, canvas_width, placement):
    """Return scaled height and width, top and left, as YOLOX (corner) and YOLOv5/v8 (centre) do."""
    r = min(canvas_height / height, canvas_width / width)
    if placement == "corner":
        return int(height * r), int(width * r), 0, 0
    h, w = round(height * r), round(width * r)
    return h, w, round((canvas_height - h) / 2 - 0.1), round((canvas_width - w) / 2 - 0.1)


def draw(image, canvas_height, canvas_width, scaled_height, scaled_width, top, left):
    """Return the canvas in float64, bilinear between the centres of pixels, grey 114 elsewhere."""
    height, width = image.shape[:2]
    canvas = np.full((canvas_height, canvas_width, 3), 114.0)
    for i in range(scaled_height):
        for j in range(scaled_width):
            y = np.clip((i + 0.5) * height / scaled_height - 0.5, 0, height - 1)
            x = np.clip((j + 0.5) * width / scaled_width - 0.5, 0, width - 1)
            y0, x0 = int(y), int(x)
            y1, x1 = min(y0 + 1, height - 1), min(x0 + 1, width - 1)
            upper = image[y0, x0] * (1 - (x - x0)) + image[y0, x1] * (x - x0)
            lower = image[y1, x0] * (1 - (x - x0)) + image[y1, x1] * (x - x0)
            canvas[top + i, left + j] = upper * (1 - (y - y0)) + lower * (y - y0)
    return canvas
