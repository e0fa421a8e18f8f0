"""Fig. 3: three cards along the axis, each sharp at one of three accommodation levels."""
import math

from paper import measure, plane, png, tan_deg

levels_D = (1, 4, 8)


def figure(f):
    # gratings of 10 cycles a degree on cards 1.7 degrees wide
    wide_deg, cycles = 1.7, 17
    tints = ((1.0, 0.75, 0.7), (0.75, 1.0, 0.75), (0.75, 0.8, 1.0))
    objects = []
    for k, level in enumerate(levels_D):
        texture = [[tuple(c * (0.5 + 0.5 * math.cos(2 * math.pi * (x + 0.5) / 20)) for c in tints[k])
                    for x in range(20 * cycles)] for _ in range(2)]
        png(f.path(f"card{k}.png"), texture)
        distance = 1000 / level
        half = distance * tan_deg(wide_deg / 2)
        objects.append(plane([-distance * tan_deg(2 * (k - 1)), 0, distance], half, 1.2 * half, f"card{k}.png"))
    f.write("scene.json", {"name": "cards", "background": [0.5, 0.5, 0.5], "objects": objects})
    width, height = 640, 320
    um = 2000 / width
    nodal_mm = 16.6  # second nodal point to retina: where to look in the picture only
    sizes = {}
    for level in levels_D:
        f.trace(f"at{level}.png", eye="navarro", scene=f.path("scene.json"), accommodation=level, pupil=4,
                size=f"{width}x{height}", field_mm="2x1", samples=64 if f.quick else 512)
        for k, card in enumerate(levels_D):
            distance = 1000 / card
            centre = width / 2 + nodal_mm * 1000 / um * distance * tan_deg(2 * (k - 1)) / (distance + 7.1)
            found = measure("modulation", f.path(f"at{level}.png"), round(centre) - 55, height // 2 - 50, 110, 100,
                            nodal_mm * 1000 / um * tan_deg(0.1))
            sizes[level, card] = found["modulation"]
    for card in levels_D:
        f.number(f"modulation of the card at {1000 / card:.0f} mm, focused", sizes[card, card], 0.2, 1)
        for level in levels_D:
            if level != card:
                f.number(f"  the card at {1000 / card:.0f} mm at {level} D: how many times less", sizes[card, card] / max(1e-6, sizes[level, card]), 3)
    f.sheet("fig3.png", 1, 480, *[(f"at{level}.png", f"accommodation {level} D: the card at {1000 / level:.0f} mm is sharp")
                                  for level in levels_D])
