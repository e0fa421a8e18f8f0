"""Curves as SVG: what the pages show where a picture has too little to read off."""
import math
from html import escape

colours = ("#1b6ca8", "#c8553d", "#3c8d5a", "#8a4fa3", "#b8860b", "#4a4a4a", "#d36ba6", "#1aa6a6", "#7f8c2b")
width, height = 560, 340
left, right, top, bottom = 62, 14, 34, 48


def ticks(low, high, most=7):
    """Round numbers from low to high: steps of 1, 2 or 5 times a power of ten."""
    power = 10 ** math.floor(math.log10((high - low) / most))
    step = next(k * power for k in (1, 2, 5, 10) if (high - low) / (k * power) <= most)
    first = math.ceil(low / step - 1e-9)
    return [k * step for k in range(first, math.floor(high / step + 1e-9) + 1)]


def plot(file, title, x_label, y_label, *curves, x=None, y=None, legend_left=False):
    """Writes curves (label, points[, "line" | "dots"]) over axes that hold them all, or from x[0] to x[1] and y[0] to y[1]; one
    without a label belongs to the curve before it and has its colour."""
    every = [p for curve in curves for p in curve[1]]
    (x0, x1), (y0, y1) = x or (min(p[0] for p in every), max(p[0] for p in every)), y or (min(p[1] for p in every), max(p[1] for p in every))
    if not y:
        y0, y1 = y0 - 0.04 * (y1 - y0), y1 + 0.04 * (y1 - y0)
    at = lambda p: (left + (p[0] - x0) / (x1 - x0) * (width - left - right),
                    height - bottom - (p[1] - y0) / (y1 - y0) * (height - top - bottom))
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
           'font-family="sans-serif" font-size="12"><rect width="100%" height="100%" fill="white"/>',
           f'<text x="{left}" y="20" font-size="14">{escape(title)}</text>']
    for value in ticks(x0, x1):
        px, _ = at((value, y0))
        out.append(f'<path d="M{px:.1f} {top}V{height - bottom}" stroke="#e4e4e4"/>'
                   f'<text x="{px:.1f}" y="{height - bottom + 16}" text-anchor="middle">{value:g}</text>')
    for value in ticks(y0, y1):
        _, py = at((x0, value))
        out.append(f'<path d="M{left} {py:.1f}H{width - right}" stroke="#e4e4e4"/>'
                   f'<text x="{left - 6}" y="{py + 4:.1f}" text-anchor="end">{value:g}</text>')
    out.append(f'<path d="M{left} {top}V{height - bottom}H{width - right}" stroke="#555" fill="none"/>')
    out.append(f'<text x="{(left + width - right) / 2}" y="{height - 10}" text-anchor="middle">{escape(x_label)}</text>')
    out.append(f'<text transform="translate(16 {(top + height - bottom) / 2}) rotate(-90)" text-anchor="middle">{escape(y_label)}</text>')
    legend = []
    longest, named = max(len(curve[0]) for curve in curves), -1
    lx = left + 10 if legend_left else width - right - 34 - 6.6 * longest
    for label, points, *style in curves:
        named += label != ""
        colour = colours[named % len(colours)]
        inside = [at(p) for p in points if x0 - 1e-9 <= p[0] <= x1 + 1e-9 and y0 - 1e-9 <= p[1] <= y1 + 1e-9]
        ring = lambda px, py: f'<circle cx="{px:.1f}" cy="{py:.1f}" r="3.2" fill="none" stroke="{colour}" stroke-width="1.4"/>'
        ly, mark = top + 14 + 16 * named, ""
        if style == ["dots"]:
            out += [ring(*p) for p in inside]
            mark = ring(lx + 10, ly - 4)
        else:
            out.append(f'<polyline fill="none" stroke="{colour}" stroke-width="1.7" points="'
                       + " ".join(f"{px:.1f},{py:.1f}" for px, py in inside) + '"/>')
            mark = f'<path d="M{lx:.0f} {ly - 4}h20" stroke="{colour}" stroke-width="2"/>'
        if label:
            legend.append(f'{mark}<text x="{lx + 26:.0f}" y="{ly}">{escape(label)}</text>')
    out.append(f'<rect x="{lx - 5:.0f}" y="{top + 1}" width="{38 + 6.6 * longest:.0f}" height="{24 + 16 * named}" fill="white" '
               'fill-opacity="0.85"/>')
    out += legend
    file.write_text("\n".join(out) + "\n</svg>\n")
