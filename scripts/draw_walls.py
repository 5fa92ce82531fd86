#!/usr/bin/env python3
"""Draws the walls and their drives for docs/scenes.md: docs/images/walls.svg and docs/images/drives.svg."""

import math
import pathlib

IMAGES = pathlib.Path(__file__).resolve().parent.parent / "docs/images"
WIDTH, HEIGHT = 240, 250
# rows of grains in a panel: places of their centres, and radii
GRAINS = [(60, 100, 20), (100, 100, 20), (140, 100, 20), (180, 100, 20), (60, 140, 20), (100, 140, 20), (140, 140, 20), (180, 140, 20)]
BLUE, ORANGE, INK = "#0072b2", "#d55e00", "#222"


def text(x, y, words, size=14, anchor="middle", colour=INK):
    return f'<text x="{x}" y="{y}" font-size="{size}" text-anchor="{anchor}" fill="{colour}">{words}</text>'


def arrow(x0, y0, x1, y1, colour):
    length = math.hypot(x1 - x0, y1 - y0)
    u, v = (x1 - x0) / length, (y1 - y0) / length
    bx, by = x1 - 10 * u, y1 - 10 * v
    head = f"{x1},{y1} {bx - 5 * v},{by + 5 * u} {bx + 5 * v},{by - 5 * u}"
    return (
        f'<line x1="{x0}" y1="{y0}" x2="{bx:.1f}" y2="{by:.1f}" stroke="{colour}" stroke-width="3"/>'
        f'<polygon points="{head}" fill="{colour}"/>'
    )


def grains(shown=GRAINS, dark=()):
    fill = lambda k: "#b0b0b0" if k in dark else "#eee"
    return "".join(f'<circle cx="{x}" cy="{y}" r="{r}" fill="{fill(k)}" stroke="#888"/>' for k, (x, y, r) in enumerate(shown))


def plane(y, above, x0=30, x1=210):
    """A horizontal plane; the side without grains is hatched."""
    side = -8 if above else 8
    marks = "".join(f'<line x1="{x}" y1="{y}" x2="{x + 8}" y2="{y + side}" stroke="#666"/>' for x in range(x0, x1 - 4, 10))
    return f'<line x1="{x0}" y1="{y}" x2="{x1}" y2="{y}" stroke="#000" stroke-width="2.5"/>' + marks


def upright(x, left):
    side = -8 if left else 8
    marks = "".join(f'<line x1="{x}" y1="{y}" x2="{x + side}" y2="{y + 8}" stroke="#666"/>' for y in range(72, 166, 10))
    return f'<line x1="{x}" y1="72" x2="{x}" y2="168" stroke="#000" stroke-width="2.5"/>' + marks


def ring(x, y, radius, inside):
    wall = f'<circle cx="{x}" cy="{y}" r="{radius}" fill="none" stroke="#000" stroke-width="2.5"/>'
    marks = []
    for k in range(36):
        angle = math.radians(10 * k)
        out = radius + (7 if inside else -7)
        a, b = (x + radius * math.cos(angle), y + radius * math.sin(angle)), (x + out * math.cos(angle + 0.08), y + out * math.sin(angle + 0.08))
        marks.append(f'<line x1="{a[0]:.1f}" y1="{a[1]:.1f}" x2="{b[0]:.1f}" y2="{b[1]:.1f}" stroke="#666"/>')
    return wall + "".join(marks)


def page(name, panels):
    """Writes panels side by side, three in a row: a title, what it shows, and a line below."""
    rows = (len(panels) + 2) // 3
    parts = []
    for k, (title, drawing, note) in enumerate(panels):
        x, y = WIDTH * (k % 3), HEIGHT * (k // 3)
        words = text(WIDTH / 2, 20, title, 15) + "".join(text(WIDTH / 2, 218 + 16 * n, line, 12) for n, line in enumerate(note))
        parts.append(f'<g transform="translate({x},{y})">{words}{drawing}</g>')
    size = f'width="{3 * WIDTH}" height="{rows * HEIGHT}" viewBox="0 0 {3 * WIDTH} {rows * HEIGHT}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="DejaVu Sans, Helvetica, Arial, sans-serif">'
    body = "\n".join(parts)
    (IMAGES / name).write_text(f'{head}\n<rect width="100%" height="100%" fill="#fff"/>\n{body}\n</svg>\n', encoding="utf-8")


def main():
    floor = plane(160, False)
    box = grains() + floor
    inside = [(120 + 44 * math.cos(a), 118 + 44 * math.sin(a), 20) for a in (0.63, 1.571, 2.512)]
    page(
        "walls.svg",
        [
            ("plane", box + arrow(120, 160, 120, 118, BLUE) + text(134, 134, "normal", 12, "start", BLUE),
             ["normal: to the side of the grains;", "infinite, and a line in 2D"]),
            ("circle, sphere, cylinder", grains([(x, y - 40, r) for x, y, r in GRAINS]) + ring(120, 152.5, 36, False)
             + arrow(190, 180, 190, 146, BLUE) + text(198, 168, "seated", 12, "start", BLUE),
             ["center, radius; grains outside: a roller;", "seated: moved until it touches a grain"]),
            ("inside: true", grains(inside) + ring(120, 118, 64, True), ["grains inside: a drum, a mould"]),
        ],
    )
    lid = plane(80, True)
    squeeze = "".join(arrow(x, 40, x, 76, ORANGE) for x in (60, 100, 140, 180))
    extent = f'<line x1="40" y1="182" x2="200" y2="182" stroke="{BLUE}" stroke-width="1.5"/>' + text(120, 198, "section A", 12, colour=BLUE)
    page(
        "drives.svg",
        [
            ("velocity", box + lid + arrow(120, 36, 120, 76, BLUE) + text(132, 56, "v(t)", 14, "start", BLUE),
             ["the wall moves at v; the load is", "the force on the grains"]),
            ("force, force_rate, mass", box + lid + arrow(120, 36, 120, 76, ORANGE) + text(132, 56, "F(t)", 14, "start", ORANGE),
             ["a wall of this mass moves under F;", "F > 0 along direction presses"]),
            ("stress, mass", box + lid + squeeze + text(206, 58, "σ(t)", 14, "start", ORANGE) + extent,
             ["F = σ A with the present section A", "of the sample"]),
            ("stress on side walls", box + upright(40, True) + upright(200, False) + arrow(6, 120, 36, 120, ORANGE)
             + arrow(234, 120, 204, 120, ORANGE) + lid + arrow(120, 36, 120, 76, BLUE),
             ["biaxial test: two sides with a stress,", "a lid with a velocity"]),
            ("slide", box + lid + arrow(90, 36, 90, 76, ORANGE) + text(82, 56, "σ", 14, "end", ORANGE)
             + arrow(120, 56, 176, 56, BLUE) + text(148, 46, "slide", 12, colour=BLUE),
             ["a velocity across a force or a stress:", "direct shear"]),
            ("grip", grains(dark=(0, 1, 2, 3)) + floor + lid + arrow(120, 76, 120, 36, BLUE) + text(132, 56, "v(t)", 14, "start", BLUE)
             + text(120, 104, "held", 12),
             ["grains near a wall that is fixed or has", "a velocity are glued to it: tension"]),
        ],
    )


if __name__ == "__main__":
    main()
