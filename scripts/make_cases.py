#!/usr/bin/env python3
"""Makes the four label maps of assets/cases: forearm, lumbar, neck, liver (NRRD, readable by 3D Slicer).

    scripts/make_cases.py                    write assets/cases/*.nrrd
    scripts/make_cases.py --paths            print the training paths, the wrong paths and what each crosses
    scripts/make_cases.py --check            verify maps, paths and the stored files; exit 1 when something is wrong
    scripts/make_cases.py --picture FOLDER   draw slices through every path (needs Pillow)

Needs numpy, else only the standard library. Names after the options restrict the work (`--check neck`).

Every shape is a formula, evaluated at the centre of each voxel: nothing comes from a scan. The axes are the patient's:
x to the left, y to the back, z to the head (LPS), unit mm, origin at a landmark named in each case. Points of paths are
RAS, as 3D Slicer shows them: x to the right, y to the front, z to the head. A dimension carries its source in square
brackets, the key of SOURCES; [choice] is a choice of this project that follows the topology of textbooks.
Only low waves drawn from a seeded generator make the surfaces uneven, so each run gives the same voxels.
"""
import argparse
import gzip
import io
import math
import random
import re
import sys
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).resolve().parent.parent / "assets" / "cases"

SOURCES = {
    "Laurent2007": "Laurent et al. 2007, skin thickness in adults by ultrasound, doi:10.1016/j.vaccine.2007.05.046",
    "JVA2015": "Ultrasound of the cephalic vein at the forearm, J Vasc Access 2015;16(5):364, doi:10.5301/jva.5000443",
    "JIC2023": "Ultrasound survey of radial and ulnar arteries, J Invasive Cardiol 2023;35(3):E143",
    "JIC2015": "Forearm arterial anatomy and flow, J Invasive Cardiol 2015;27(4):218",
    "Pretorius2021": "Pretorius et al. 2021, CT study of forearm osteology, doi:10.17159/2309-8309/2021/v20n3a5",
    "SRA2006": "Medullary cavity of the ulna, Surg Radiol Anat 2006, doi:10.1007/s00276-006-0170-4",
    "Lee2004": "Lee & Kim 2004, epidural depth at L3-4 by MRI, doi:10.4097/kjae.2004.47.1.34",
    "Bevacqua1996": "Bevacqua et al. 1996, posterior epidural space depth, Reg Anesth 21(5):456",
    "ASJ2015": "Thickness of the ligamentum flavum by MRI 2015, doi:10.4184/asj.2015.9.2.245",
    "Sobottke2010": "Sobottke et al. 2010, CT of lumbar spinous processes, Surg Radiol Anat 32(8):731",
    "SpineJ2011": "Dural sac thickness in cadavers 2011, doi:10.1016/j.spinee.2011.11.001",
    "Gujarat2012": "Canal/body ratio of lumbar vertebrae, Gujarat 2012 (dry vertebrae, L1-L5)",
    "KJA2004": "Ultrasound anatomy of the internal jugular vein 2004, doi:10.4097/kjae.2004.47.4.499",
    "Olayode2025": "Olayode et al. 2025, depth of the internal jugular vein, doi:10.1177/08850666251364227",
    "Krejza2006": "Krejza et al. 2006, carotid diameter, doi:10.1161/01.STR.0000206440.48756.f7",
    "KJORL2004": "Thyroid dimensions by CT, Korean J Otolaryngol 2004;47(11):1151",
    "LeeDH1988": "Lee et al. 1988, normal trachea by CT, J Korean Radiol Soc 24(2):265",
    "Breatnach1984": "Breatnach et al. 1984, normal trachea, doi:10.2214/ajr.142.5.903",
    "Riley2005": "Riley & Bruno 2005, skin to liver distance by ultrasound, J Clin Ultrasound 33(9):439",
    "Gray": "Topology as in textbooks such as Gray's Anatomy, from general knowledge, not looked up for this script",
}


class Grid:
    """Voxel centres of a box in LPS mm; x, y, z broadcast against each other, arrays are indexed [z, y, x]."""

    def __init__(self, low, high, step):
        self.step, self.low, self.size = step, low, [round((b - a) / step) for a, b in zip(low, high)]
        self.axes = [np.float32(a) + np.float32(step) * (np.arange(n, dtype=np.float32) + np.float32(0.5))
                     for a, n in zip(low, self.size)]
        self.x, self.y, self.z = (axis.T for axis in np.meshgrid(*self.axes, indexing="ij", sparse=True))
        self.shape = tuple(reversed(self.size))
        # Angle in the axial plane, degrees, 0 to the front and 90 to the patient's right, and the radius.
        self.phi, self.r = np.degrees(np.arctan2(-self.x, -self.y)), np.hypot(self.x, self.y)

    def box(self, low, high):
        """Slices [z, y, x] of the voxels between two corners."""
        ends = [[int(np.searchsorted(axis, p)) for p in pair] for axis, *pair in zip(self.axes, low, high)]
        return tuple(slice(*pair) for pair in reversed(ends))


def waves(seed, shortest=26.0, longest=70.0, count=7):
    """A smooth field about between -1 and 1: the mean of a few plane waves with seeded directions and phases."""
    rng, terms = random.Random(seed), []
    for _ in range(count):
        u, v, k = rng.uniform(-1, 1), rng.uniform(0, 2 * math.pi), 2 * math.pi / rng.uniform(shortest, longest)
        side = k * math.sqrt(1 - u * u)
        terms.append((side * math.cos(v), side * math.sin(v), k * u, rng.uniform(0, 2 * math.pi)))
    return lambda x, y, z: sum(np.cos(a * x + b * y + c * z + phase) for a, b, c, phase in terms) * (1.6 / count)


def distance(level, step):
    """First order distance to level = 0 (positive inside) of any smooth field."""
    return level / np.sqrt(sum(s * s for s in np.gradient(level, step)) + 1e-12)


def smooth_max(a, b, k):
    h = np.clip(0.5 + 0.5 * (a - b) / k, 0, 1)
    return b + (a - b) * h + k * h * (1 - h)


def ellipse(u, v, a, b, power=2.0):
    """Below 1 inside."""
    return np.abs(u / a) ** power + np.abs(v / b) ** power


def curve(points, per_segment=8):
    """Catmull-Rom spline through rows of (x, y, z, radius)."""
    p, out = np.array(points, dtype=float), []
    p = np.vstack([2 * p[0] - p[1], p, 2 * p[-1] - p[-2]])
    for a, b, c, d in zip(p, p[1:], p[2:], p[3:]):
        out += [0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t ** 2 + (3 * b - a - 3 * c + d) * t ** 3)
                for t in np.arange(per_segment) / per_segment]
    return np.array(out + [p[-2]])


def tube_distance(grid, points, box):
    """Distance to a chain of rows (x, y, z, radius), negative inside, for the voxels of a box."""
    z, y, x = grid.z[box[0]], grid.y[:, box[1]], grid.x[:, :, box[2]]
    best = np.full((z.shape[0], y.shape[1], x.shape[2]), 1e3, dtype=np.float32)
    for a, b in zip(points[:-1], points[1:]):
        d = b[:3] - a[:3]
        t = np.clip(((x - a[0]) * d[0] + (y - a[1]) * d[1] + (z - a[2]) * d[2]) / max(d @ d, 1e-9), 0, 1)
        gap = (x - a[0] - t * d[0]) ** 2 + (y - a[1] - t * d[1]) ** 2 + (z - a[2] - t * d[2]) ** 2
        np.minimum(best, np.sqrt(gap) - (a[3] + t * (b[3] - a[3])), out=best)
    return best


def tube(grid, vol, label, points, over=None, smooth=True):
    """Paints a tube through rows (x, y, z, radius), only over the given labels."""
    rows = curve(points) if smooth else np.array(points, dtype=float)
    reach = rows[:, 3].max() + grid.step
    box = grid.box(rows[:, :3].min(0) - reach, rows[:, :3].max(0) + reach)
    paint(vol[box], tube_distance(grid, rows, box) < 0, label, over)


def paint(vol, mask, label, over=None):
    vol[np.broadcast_to(mask, vol.shape) & (True if over is None else np.isin(vol, over))] = label


def forearm(grid):
    """Right forearm hanging in anatomical position (supine hand), middle third. Origin: middle of the section."""
    skin, fat, muscle, cortex, marrow, radial, ulnar, vein, membrane = range(1, 10)
    x, y, z = grid.x, grid.y, grid.z
    w = waves(11)(x, y, z)
    # Half widths 36 x 30 mm, 1 mm per 20 mm narrower to the wrist: a slender adult [choice].
    a, b = 36.0 + 0.05 * z, 30.0 + 0.04 * z
    rho = (np.abs(x / a) ** 2.15 + np.abs(y / b) ** 2.15) ** (1 / 2.15) * (1 + 0.012 * w)
    d = distance(1 - rho, grid.step)
    phi, r = grid.phi, grid.r
    vol = np.zeros(grid.shape, np.uint8)
    vol[d > 0] = skin
    # Skin 1.5 mm: 1.55 mm at the thigh, 2.02 mm over the deltoid, thinner towards the hand [Laurent2007].
    # Fat 3-6 mm, thickest on the radial side of the front where the vein runs [choice].
    vein_at = 50.0 + 0.10 * z
    thick = np.clip(4.5 + 1.0 * np.cos(np.radians(phi - vein_at)) + 0.5 * waves(12)(x, y, z), 3.0, 6.0)
    vol[d > 1.5] = fat
    vol[d > 1.5 + thick] = muscle
    # Bones, 13-14 mm wide; canal 5.2 mm (radius), 4.8 +- 1.3 mm (ulna) at its narrowest [Pretorius2021];
    # ulna: cortex 2-8 mm, canal 4-10.5 mm [SRA2006]. Crests point to the other bone, the ulna's also to the skin.
    for cx, cy, bow, size, crest, canal in ((-14.0, 5.0, 0.0012, 6.6, 15.0, 2.8), (14.5, 12.0, 0.0, 6.3, 200.0, 2.6)):
        u, v = x - cx + bow * z * z, y - cy + 0.02 * z
        turn = np.degrees(np.arctan2(v, u)) - crest
        edge = size * (1 + 0.09 * np.cos(3 * np.radians(turn)) + 0.06 * np.cos(np.radians(turn)) + 0.02 * w)
        paint(vol, np.hypot(u, v) < edge, cortex, [fat, muscle])
        paint(vol, np.hypot(u - 0.3, v) < canal * (1 + 0.05 * w), marrow, [cortex])
    # Interosseous membrane, 1.4 mm: the thinnest layer that stays closed [choice].
    t = np.clip(((x + 12.0) * 24.0 + (y - 6.0) * 4.5) / (24.0 ** 2 + 4.5 ** 2), 0, 1)
    paint(vol, np.hypot(x + 12.0 - 24.0 * t, y - 6.0 - 4.5 * t + 0.02 * z) < 0.7, membrane, [muscle])
    # Arteries: radial 3.0 mm, ulnar 2.7 mm [JIC2023]; 2.0 mm each at the wrist [JIC2015]. Radial under the
    # brachioradialis, ulnar between the deep and the superficial flexors [Gray].
    tube(grid, vol, radial, [(-16, -12, 31, 1.45), (-16.5, -13, 10, 1.4), (-17.2, -13.8, -10, 1.4),
                             (-17.6, -14.5, -31, 1.35)], [muscle])
    tube(grid, vol, ulnar, [(8, -6.5, 31, 1.4), (10, -7.6, 10, 1.35), (11.3, -8.6, -10, 1.35), (12.2, -9.5, -31, 1.3)],
         [muscle])
    # Cephalic vein 2.9 +- 0.65 mm [JVA2015], in the fat with 1 mm of fat above it [choice].
    side = r * np.radians(phi - vein_at)
    paint(vol, np.hypot(side, d - 4.0) < 1.55 + 0.08 * w, vein, [fat])
    return vol


def lumbar(grid):
    """Lumbar spine L3-L4 of a patient lying prone. Origin: skin of the midline over the interspace; depth q = -y."""
    (skin, fat, supra, inter, flavum, epidural, dura, csf, bone3, bone4, disc, muscle, cartilage) = range(1, 14)
    x, q, z = grid.x, -grid.y, grid.z
    side, w = np.abs(x), waves(21)(x, grid.y, z)
    level = lambda seed: waves(seed)(x, grid.y, z) - waves(seed)(0.0, 0.0, 0.0)  # 0 at the entry of the needle
    # Back: furrow in the midline between the bulges of the erector spinae, slight lordosis [choice].
    back = 0.0012 * z ** 2 + 3.2 * (1 - np.exp(-(x / 13.0) ** 2)) - x ** 2 / 260.0 + 0.35 * level(21)
    d = distance(back - grid.y, grid.step)
    vol = np.zeros(grid.shape, np.uint8)
    vol[d > 0] = skin
    # Skin 2 mm: 1.91 mm at the waist, 2.54 mm over the shoulder blade [Laurent2007]. Fat 8-15 mm, here 11 mm in the
    # midline, so that the epidural space lies 42 mm deep: 42-48 mm at L3-4 [Lee2004], 27-94 mm [Bevacqua1996].
    vol[d > 2.0] = fat
    vol[d > 10.7 + 2.3 * np.exp(-(x / 9.0) ** 2) + 0.5 * level(22)] = muscle
    # Ligaments: supraspinous 10 mm wide, 4 mm thick; interspinous 5.4 mm wide [choice].
    paint(vol, (side < 2.7 + 0.25 * w) & (q > 15.0) & (q < 50.0), inter, [muscle])
    paint(vol, ellipse(x, q - 13.4, 5.2, 3.8) < 1, supra, [muscle, inter])
    # Canal: rounded triangle, apex 42 mm deep, front wall at 62.5 mm, 23 mm wide (22.6-27 mm between the pedicles
    # [Gujarat2012]). Outside distance `g` in the axial plane.
    px, pq = grid.axes[0][None, :], -grid.axes[1][:, None]
    wedge = (42.0 - pq + 0.9 * (np.sqrt(px ** 2 + 4.0) - 2.0)) / math.sqrt(1.81)
    walls = smooth_max(np.abs(px) - 11.5 + 0 * pq, pq - 62.5 + 0 * px, 4.0)
    g = distance(smooth_max(wedge, walls, 3.0), grid.step)[None]
    # Flavum 4 mm: 3.4 +- 0.9 mm [ASJ2015]. Fat lies in the canal and the foramina.
    paint(vol, (g >= 0) & (g < 4.0 + 0.3 * w * (side > 3)) & (q < 51) & (side < 15), flavum, [muscle, inter])
    hole = ellipse(side - 9.0, q - 57.2, 9.0, 5.2) + ((z - 5.0) / 15.0) ** 2
    front = (ellipse(x, q - 60.0, 14.5, 5.0, 2.6) < 1) & (q > 56)
    # Vertebral bodies, half widths 23 x 17 mm (width 36-46 mm [Gujarat2012]), discs of 10.6 mm [choice].
    body = ellipse(x, q - 79.6, 23.0, 17.2, 2.6)
    paint(vol, (hole < 1) | front, epidural, [muscle, inter])
    cup = 5.3 - 0.9 * np.clip(1 - (x / 20.0) ** 2, 0, 1) * np.clip((q - 62.0) / 8.0, 0, 1)
    bones = np.zeros(grid.shape, np.uint8)
    paint(bones, (body < 1) & (z >= cup), bone3)
    paint(bones, (body < 1) & (z <= -cup), bone4)
    paint(vol, (body < 1) & (bones == 0), disc)
    for label, lamina, process, pedicle in ((bone3, 15.5, 15.2, 25.0), (bone4, -17.3, -15.5, -12.5)):
        # Laminae 6.6 mm thick, 19 mm high [choice].
        shell = np.abs((g - 3.2) / 3.5) ** 2.5 + np.abs((z - lamina) / 9.6) ** 4
        paint(bones, (shell < 1) & (q < 57) & (g > 0), label)
        # Spinous process: 21 mm high, 7 mm thick [choice]; space between two of them 9.1 +- 2.5 mm, narrower to the
        # back [Sobottke2010]: here 9 mm behind, 11.5 mm in front.
        tip = np.clip((36.0 - q) / 20.0, 0, 1.1)
        high = 9.7 + 1.5 * tip
        blade = np.abs((q - 28.0) / 13.0) ** 4 + np.abs((z - process + 1.2 * tip) / high) ** 4 \
            + np.abs(x / (3.2 + 1.0 * tip ** 3 + 0.15 * w)) ** 2.5
        paint(bones, blade < 1, label)
        for s in (-1, 1):
            # Pedicle and transverse process [choice].
            tube(grid, bones, label, [(s * 16.3, -51.0, pedicle, 5.6), (s * 15.6, -68.0, pedicle, 6.4)], smooth=False)
            tube(grid, bones, label, [(s * 19.0, -50.0, pedicle, 4.6), (s * 27.0, -46.5, pedicle + 0.6, 4.0),
                                      (s * 40.0, -44.0, pedicle + 1.0, 3.6)])
    for s in (-1, 1):
        # Facet joint: inferior process of L3 inside and behind, superior process of L4 outside and in front.
        upper = np.array([(s * 10.5, -39.5, 11.0, 4.6), (s * 13.0, -41.5, -2.5, 5.4)])
        lower = np.array([(s * 17.5, -51.0, -10.0, 5.0), (s * 18.8, -47.6, 5.0, 5.4)])
        box = grid.box((min(s * 5, s * 26), -60, -18), (max(s * 5, s * 26), -30, 20))
        up, low = tube_distance(grid, upper, box), tube_distance(grid, lower, box)
        part = bones[box]
        paint(part, (up < 0) & (up < low - 1.2) & (part != bone4), bone3)
        paint(part, (low < 0) & (low < up - 1.2) & (part != bone3), bone4)
        paint(part, (up < 0.3) & (low < 0.3) & (np.abs(up - low) <= 1.2) & (part == 0), cartilage)
    vol[bones > 0] = bones[bones > 0]
    # Canal content. Dural sac 18 x 14 mm [choice], its back 47 mm deep: 5 mm of epidural space, 2-25 mm, mean 6.9 mm
    # [Bevacqua1996]. Dura 0.31 +- 0.12 mm [SpineJ2011], here 1 mm: the thinnest layer that two voxels keep closed.
    paint(vol, (g < 0) & (q > 40), epidural)
    sq = q - 54.0 - 0.0006 * z ** 2
    rho = np.sqrt((x / 9.0) ** 2 + (sq / 7.0) ** 2) + 1e-6
    sac = (1 - rho) * rho / (np.sqrt((x / 81.0) ** 2 + (sq / 49.0) ** 2) + 1e-9)
    paint(vol, sac > 0, dura, [epidural])
    paint(vol, sac > 1.02, csf, [dura])
    return vol


def neck(grid):
    """Right side of the neck at the cricoid. Origin: centre of the neck in the plane of the cricoid."""
    (skin, fat, platysma, scm, jugular, carotid, thyroid, cartilage, airway, gullet, muscle, bone, disc) = range(1, 14)
    x, y, z = grid.x, grid.y, grid.z
    w = waves(31)(x, y, z)
    # Circumference about 370 mm [choice].
    rho = np.sqrt((x / 60.0) ** 2 + (y / 57.5) ** 2) * (1 + 0.006 * w - 0.0003 * z)
    d = distance(1 - rho, grid.step)
    phi, r = grid.phi, grid.r
    vol = np.zeros(grid.shape, np.uint8)
    # Skin 1.5 mm: between thigh (1.55 mm) and deltoid (2.02 mm) [Laurent2007]. Fat above the platysma 2.5 mm,
    # platysma 1.3 mm, sternocleidomastoid 5.6 mm thick and 38 mm wide [choice].
    vol[d > 0] = skin
    vol[d > 1.5] = fat
    top = 4.0 + 0.3 * waves(32)(x, y, z)
    paint(vol, (d > top) & (d < top + 1.3) & (phi > 14) & (phi < 125), platysma, [fat])
    across = r * np.radians(phi - (56.0 + 0.45 * z))
    paint(vol, ellipse(across, d - (top + 1.0 + 2.9), 19.0, 2.9, 2.4) < 1, scm, [fat])
    # Muscles behind and in front: infrahyoid, longus colli, scalene, levator scapulae [Gray].
    paint(vol, ellipse(r * np.radians(phi - 17.0 - 0.05 * z), d - 8.4, 13.0, 2.2, 2.4) < 1, muscle, [fat])
    for cx, cy, a, b in ((-9.0, -17.5, 8.0, 4.2), (9.0, -17.5, 8.0, 4.2), (-30.0, -10.5, 9.0, 7.0),
                         (-41.0, 3.0, 16.0, 13.0), (-21.0, 3.0, 12.0, 8.0), (18.0, -5.0, 12.0, 14.0)):
        paint(vol, (ellipse(x - cx, y - cy, a, b) * (1 + 0.12 * w) < 1) & (d > 7.0), muscle, [fat])
    # C5-C7: body 27 mm wide, 12.4 mm high, 5 mm of disc, transverse processes with their front tubercle [choice].
    body = ellipse(x, y + 5.5, 13.5, 9.0, 2.6) < 1
    paint(vol, body, disc)
    paint(vol, body & (np.abs(z - 17.5 * np.round(z / 17.5)) < 6.2), bone)
    for k, s in ((k, s) for k in (-17.5, 0.0, 17.5) for s in (-1, 1)):
        tube(grid, vol, bone, [(s * 11.0, -3.0, k, 4.2), (s * 20, -5.0, k - 1.5, 3.8), (s * 24.5, -8, k - 2.5, 3.4)])
    # Airway 15.6 x 17.6 mm: 15.3-17.7 mm wide, 15.5-18.9 mm deep [LeeDH1988], 13-27 mm [Breatnach1984]; wall 2 mm,
    # 3 mm in the cricoid, more at its back [choice].
    wall = 2.0 + 1.0 / (1 + np.exp(-(z + 7.0))) + 1.4 * np.clip((y + 34.0) / 8.0, 0, 1)
    paint(vol, ellipse(x, y + 38.0, 7.8 + wall, 8.8 + wall) < 1, cartilage)
    paint(vol, ellipse(x, y + 38.0, 7.8, 8.8) < 1, airway)
    paint(vol, ellipse(x - 2.5, y + 23.2, 8.0, 3.2) < 1, gullet, [fat, muscle])
    # Thyroid lobe 13.6 x 19 mm: 15.7 x 20.9 mm, 61.8 mm long [KJORL2004]; upper pole at the top of the map.
    pole = np.sqrt(np.clip(1 - ((z + 14.0) / 31.0) ** 2, 0.0, 1))
    lobe = ellipse(x + 12.6, y + 36.0, 6.8 * pole + 1e-3, 9.5 * pole + 1e-3)
    paint(vol, lobe * (1 + 0.08 * w) < 1, thyroid, [fat, muscle])
    # Vessels in a frame at the skin 46 degrees to the right: u along the skin to the middle, v inwards. Jugular vein
    # 13 x 9 mm: width 14.2 mm, area 100 mm2 [KJA2004]; its middle 16 mm deep: 14.8 +- 3.5 mm, its back wall 20.5 mm:
    # 20.7 mm [Olayode2025].
    s, c = math.sin(math.radians(46.0)), math.cos(math.radians(46.0))
    reach, n = 1 / math.hypot(s / 60.0, c / 57.5), np.array([s / 60.0 ** 2, c / 57.5 ** 2])
    n = n / np.hypot(*n)
    ax, ay = x + reach * s + 0.06 * z, y + reach * c - 0.05 * z
    u, v = ax * n[1] - ay * n[0], ax * n[0] + ay * n[1]
    size = 1 + 0.06 * np.sin(z / 9.0) - 0.004 * z
    paint(vol, ellipse(u, v - 16.0, 6.5 * size, 4.5 * size) < 1, jugular, [fat, muscle])
    # Common carotid artery 6.6 mm: 6.1 +- 0.8 mm (women), 6.5 +- 1.0 mm (men) [Krejza2006].
    paint(vol, np.hypot(u - 7.9, v - 22.0) < 3.3, carotid, [fat, muscle, thyroid])
    return vol


def liver(grid):
    """Right side, 8th or 9th intercostal space. Origin: skin in the middle of the space."""
    skin, fat, muscle, rib, bundle, parenchyma, vessel, lesion = range(1, 9)
    x, y, z = grid.x, grid.y, grid.z
    w = waves(41)(x, y, z)
    # Side of the trunk: radius 130 mm in the axial plane [choice].
    d = distance(x - y ** 2 / 260.0 - z ** 2 / 900.0 + 0.4 * (w - waves(41)(0.0, 0.0, 0.0)), grid.step)
    vol = np.zeros(grid.shape, np.uint8)
    vol[d > 0] = skin
    # Skin 2 mm: 1.91 mm at the waist [Laurent2007]. Skin to liver 19.5 mm: 19.5 +- 5.2 mm [Riley2005], of it fat 7.5 mm
    # and 10 mm of muscle: external oblique or serratus, intercostals and diaphragm in one label [choice].
    vol[d > 2.0] = fat
    vol[d > 9.5 + 0.6 * waves(42)(x, y, z)] = muscle
    vol[d > 19.5 + 0.4 * waves(43)(x, y, z)] = parenchyma
    # Ribs 12.4 mm high, 7 mm thick, 27 mm apart, falling 24 degrees to the front; space of 15 mm; a bundle of artery
    # and vein 2.4 mm thick below each rib (position [Gray], size [choice]).
    slope = math.radians(24.0)
    for centre in (14.8, -14.8):
        across = (z - centre) * math.cos(slope) - y * math.sin(slope) + 0.002 * y ** 2
        paint(vol, ellipse(across - 0.3 * w, d - 14.2, 6.2, 3.5, 2.3) < 1, rib, [muscle])
        paint(vol, np.hypot(across + 7.3, d - 16.2) < 1.2, bundle, [muscle])
    # Hepatic vein, radius 3 mm at its root, 1-2 mm in the branches [choice].
    t = [(66, 30, 24, 3.2), (56, 24, 21, 3.1), (46, 18, 20, 3.0), (36, 15, 18, 2.9), (30, 9.5, 14, 2.8),
         (27.2, 3, 9.5, 2.7)]
    branches = [t, [t[5], (26.8, -5, 10.2, 2.1), (29, -14, 14, 1.8), (33, -22, 19, 1.4), (38, -30, 22, 1.2)],
                [(27.0, 1, 9.2, 2.3), (26.8, -8, 6, 1.8), (28, -16, -2, 1.6), (33, -21, -11, 1.4), (38, -26, -20, 1.1)],
                [t[2], (47, 20, 9, 2.1), (44, 21, -2, 1.9), (41, 19, -13, 1.6), (42, 15, -24, 1.2)],
                [(44, 21, -2, 1.6), (36, 24, -8, 1.4), (30, 27, -16, 1.1)],
                [(56, 24, 21, 2.4), (59, 14, 15, 2.0), (60, 2, 8, 1.8), (57, -10, 2, 1.5), (53, -22, -4, 1.1)],
                [(60, 2, 8, 1.6), (62, -4, -6, 1.4), (59, -8, -18, 1.1)]]
    for rows in branches:
        tube(grid, vol, vessel, rows, [parenchyma])
    # Lesion 15 mm, its middle 40 mm deep [choice].
    ball = np.sqrt((x - 40.0) ** 2 + (y - 4.0) ** 2 + (z - 8.0) ** 2)
    paint(vol, ball < 7.5 * (1 + 0.05 * waves(44, 14, 30)(x, y, z)), lesion, [parenchyma])
    return vol


SKIN, FAT, MUSCLE, BONE = (222, 170, 140), (244, 214, 110), (165, 75, 70), (240, 232, 200)
ARTERY, VEIN, CARTILAGE = (215, 30, 40), (50, 90, 200), (150, 200, 215)
LIGAMENT, DISC = (190, 190, 195), (110, 170, 140)


class Case:
    """A map and what must be true of it. `labels`: (name, colour, number of connected pieces), value 1 first. `closed`:
    inner label and the only label that may touch it. `paths`: (name, entry, target, crossings), points in RAS mm, the
    training path first; crossings in their order, with the least and the most length in mm where it is checked."""

    def __init__(self, build, low, high, step, labels, closed, paths):
        self.build, self.name, self.low, self.high, self.step = build, build.__name__, low, high, step
        self.labels, self.closed, self.paths, self.grid = labels, closed, paths, Grid(low, high, step)
        self.names = ["air"] + [name for name, _, _ in labels]


CASES = [
    Case(forearm, (-41, -35, -30), (41, 35, 30), 0.5, [
        ("skin", SKIN, 1), ("fat", FAT, 1), ("muscle", MUSCLE, 1), ("cortical bone", BONE, 2),
        ("bone marrow", (225, 150, 90), 2), ("radial artery", ARTERY, 1), ("ulnar artery", (240, 110, 60), 1),
        ("cephalic vein", VEIN, 1), ("interosseous membrane", LIGAMENT, 1)],
        [("air", "skin"), ("bone marrow", "cortical bone")],
        [("training: cephalic vein at 27 degrees", (25.0, 22.3, -6.0), (23.1, 19.2, 2.0),
          "skin 3 4.2, fat 1 3, cephalic vein 2.5 5"),
         ("wrong: too medial and steep, radial artery", (22.3, 24.5, 0.0), (16.8, 13.4, 0.0),
          "skin 1.2 2, fat 3 6.3, muscle 2 6, radial artery 1 3"),
         ("wrong: at a right angle through the vein to the radius", (25.5, 22.3, 0.0), (14.5, -3.0, 0.0),
          "skin 1.2 2, fat 0.8 2, cephalic vein 1.5 3.5, fat, muscle, cortical bone 2 8, bone marrow")]),
    Case(lumbar, (-33, -72, -32), (33, 8, 32), 0.5, [
        ("skin", SKIN, 1), ("fat", FAT, 1), ("supraspinous ligament", (120, 120, 135), 1),
        ("interspinous ligament", LIGAMENT, 3), ("ligamentum flavum", (225, 140, 30), 3),
        ("epidural fat", (250, 235, 150), 1), ("dura", (110, 40, 150), 1), ("cerebrospinal fluid", (90, 190, 235), 1),
        ("bone L3", BONE, 1), ("bone L4", (222, 205, 160), 1), ("intervertebral disc", DISC, 1), ("muscle", MUSCLE, 2),
        ("joint cartilage", CARTILAGE, 2)], [("air", "skin"), ("cerebrospinal fluid", "dura")],
        [("training: lumbar puncture in the midline", (0.0, 0.0, 0.0), (0.0, 52.0, 0.0),
          "skin 1.6 2.5, fat 8 15, supraspinous ligament 3 5, interspinous ligament 18 24, ligamentum flavum 3 5, "
          "epidural fat 4 6, dura 0.9 1.1, cerebrospinal fluid"),
         ("wrong: 10 mm higher, spinous process of L3", (0.0, 0.0, 10.0), (0.0, 35.0, 10.0),
          "skin 1.6 2.5, fat 8 15, supraspinous ligament 1 5, bone L3"),
         ("wrong: 14 degrees to the right, inferior process of L3", (0.0, 0.0, 0.0), (11.5, 45.0, 0.0),
          "skin 1.6 2.5, fat 8 15, supraspinous ligament 1 5, muscle, bone L3")]),
    Case(neck, (-66, -62, -28), (12, 0, 28), 0.5, [
        ("skin", SKIN, 1), ("fat", FAT, 1), ("platysma", (215, 120, 110), 1),
        ("sternocleidomastoid muscle", (150, 50, 50), 1), ("internal jugular vein", VEIN, 1),
        ("common carotid artery", ARTERY, 1), ("thyroid", (190, 95, 150), 1), ("cartilage", CARTILAGE, 1),
        ("airway", (30, 40, 60), 1), ("oesophagus", (130, 105, 60), 1), ("muscle", MUSCLE, 4), ("bone", BONE, 3),
        ("intervertebral disc", DISC, 4)], [("air", "skin"), ("airway", "cartilage")],
        [("training: internal jugular vein, 35 degrees downwards", (43.0, 40.8, 7.0), (31.0, 29.4, -4.0),
          "skin 1.5 2.5, fat 2 4, platysma 1 2, sternocleidomastoid muscle 5 8.5, fat, internal jugular vein 4 8"),
         ("wrong: 14 mm too medial, carotid artery", (31.0, 49.5, 0.0), (21.4, 30.3, 0.0),
          "skin 1 2, fat 2 4, platysma 1 2, fat, common carotid artery 2 5"),
         ("wrong: too deep, through the vein to the transverse process", (42.5, 40.9, 0.0), (22.0, 7.0, -1.0),
          "skin 1 2, fat 2 4, platysma 1 2, sternocleidomastoid muscle 4 7, fat, internal jugular vein 6 10, fat, "
          "muscle, bone")]),
    Case(liver, (-10, -32, -32), (66, 32, 32), 0.5, [
        ("skin", SKIN, 1), ("fat", FAT, 1), ("muscle", MUSCLE, 1), ("rib bone", BONE, 2),
        ("intercostal vessels", (200, 60, 120), 2), ("liver", (150, 85, 60), 1), ("hepatic vein", VEIN, 1),
        ("lesion", (235, 235, 90), 1)], [("air", "skin")],
        [("training: above the lower rib, 19 degrees upwards", (0.0, -4.0, -6.0), (-40.0, -4.0, 8.0),
          "skin 1.6 2.5, fat 5 10, muscle 8 12, liver 10 20, lesion 6 9"),
         ("wrong: straight, bundle under the upper rib and hepatic vein", (0.0, -4.0, 8.0), (-40.0, -4.0, 8.0),
          "skin 1.6 2.5, fat 5 10, muscle, intercostal vessels 1 3, muscle, liver, hepatic vein 3 6, liver, lesion"),
         ("wrong: too high, upper rib", (-0.5, -4.0, 15.0), (-16.0, -4.0, 15.0),
          "skin 1.6 2.5, fat 5 10, muscle, rib bone 4 8")]),
]


def pieces(vol):
    """6-connected pieces: label and number of voxels of each, and the piece of each voxel (runs along x, merged)."""
    start = np.ones(vol.shape, bool)
    start[:, :, 1:] = vol[:, :, 1:] != vol[:, :, :-1]
    run, labels = np.cumsum(start.ravel()).reshape(vol.shape) - 1, vol[start]
    edges = []
    for here, there in ((np.s_[1:], np.s_[:-1]), (np.s_[:, 1:], np.s_[:, :-1])):
        same = vol[here] == vol[there]
        edges.append(np.unique(run[here][same].astype(np.int64) * len(labels) + run[there][same]))
    a, b = np.divmod(np.unique(np.concatenate(edges)), len(labels))
    root, before = np.arange(len(labels)), None
    while not np.array_equal(root, before):
        before, low = root.copy(), np.minimum(root[a], root[b])
        np.minimum.at(root, root[a], low)
        np.minimum.at(root, root[b], low)
        root = root[root]
    _, number = np.unique(root, return_inverse=True)
    piece = number[run]
    count = np.bincount(piece.ravel())
    label = np.zeros(len(count), np.uint8)
    label[number] = labels
    return label, count, piece


def build(case, least=60):
    """The map; pieces below `least` voxels, left where surfaces meet, get the label of a voxel beside them."""
    vol = case.build(case.grid)
    for _ in range(6):
        _, count, piece = pieces(vol)
        small = count[piece] < least
        for axis, shift in ((a, s) for a in range(3) for s in (1, -1)):
            near, near_small = np.roll(vol, shift, axis), np.roll(small, shift, axis)
            take = small & ~near_small & (near != vol)
            vol[take] = near[take]
            small &= ~take
    return vol


def crossings(case, vol, entry, target, step=0.05, ahead=8.0):
    """(label, from, to) in mm from the first voxel of skin on the line, by the nearest voxel every 0.05 mm; and how far
    that lies behind `entry`. Runs under 0.25 mm, half a voxel, are stairs of a slant and join the run before."""
    grid, (a, b) = case.grid, (np.array([-p[0], -p[1], p[2]], float) for p in (entry, target))
    length = np.linalg.norm(b - a)
    s = np.arange(-ahead + step / 2, length, step)
    index = np.floor((a + s[:, None] * (b - a) / length - np.array(grid.low)) / grid.step).astype(int)
    inside = np.all((index >= 0) & (index < np.array(grid.size)), axis=1)
    values = np.where(inside, vol[tuple(np.clip(index, 0, np.array(grid.size) - 1).T[::-1])], 0)
    first = int(np.argmax(values > 0))
    values, off, out = values[first:], s[first] - step / 2, []
    begins = [0] + (np.flatnonzero(np.diff(values)) + 1).tolist()
    for begin, end in zip(begins, begins[1:] + [len(values)]):
        if out and ((end - begin) * step < 0.25 or out[-1][0] == values[begin]):
            out[-1][2] = end * step
        else:
            out.append([values[begin], begin * step, end * step])
    return [(case.names[v], round(float(p), 2), round(float(q), 2)) for v, p, q in out], float(off)


def path_text(case, vol):
    lines = [f"{case.name}: " + ", ".join(f"{value} {name}" for value, name in enumerate(case.names))]
    for name, entry, target, _ in case.paths:
        lines.append(f"  {name}: entry {entry}, target {target} RAS mm, {math.dist(entry, target):.1f} mm")
        lines += [f"    {p:6.2f} to {q:6.2f}  {label}" for label, p, q in crossings(case, vol, entry, target)[0]]
    return "\n".join(lines)


def encode(case, vol):
    """The file: NRRD header with the segmentation fields of 3D Slicer, then the voxels, x fastest."""
    grid, extent = case.grid, " ".join(f"0 {n - 1}" for n in case.grid.size)
    text = ["NRRD0004", f"# {case.name}: label map made by scripts/make_cases.py of Stylet, not from a scan",
            "type: unsigned char", "dimension: 3", "space: left-posterior-superior",
            "sizes: " + " ".join(map(str, grid.size)),
            "space directions: ({0},0,0) (0,{0},0) (0,0,{0})".format(grid.step),
            "kinds: domain domain domain", "encoding: gzip",
            "space origin: (" + ",".join(f"{low + grid.step / 2:g}" for low in grid.low) + ")"]
    for i, (name, colour, _) in enumerate(case.labels):
        fields = {"ID": "_".join(name.split()), "Name": name, "NameAutoGenerated": 0, "LabelValue": i + 1, "Layer": 0,
                  "Color": " ".join(f"{c / 255:.4f}" for c in colour), "ColorAutoGenerated": 0, "Extent": extent}
        text += [f"Segment{i}_{key}:={value}" for key, value in fields.items()]
    text += ["Segmentation_MasterRepresentation:=Binary labelmap", "Segmentation_ReferenceImageExtentOffset:=0 0 0"]
    packed = io.BytesIO()
    with gzip.GzipFile(filename="", mode="wb", compresslevel=9, fileobj=packed, mtime=0) as stream:
        stream.write(np.ascontiguousarray(vol).tobytes())
    return ("\n".join(text) + "\n\n").encode() + packed.getvalue()


def touching(vol):
    """Pairs of labels whose voxels share a face, an edge or a corner."""
    pairs = set()
    for move in ((a, b, c) for a in (0, 1) for b in (-1, 0, 1) for c in (-1, 0, 1) if (a, b, c) > (0, 0, 0)):
        one = vol[tuple(slice(max(0, -m), n - max(0, m)) for m, n in zip(move, vol.shape))]
        two = vol[tuple(slice(max(0, m), n - max(0, -m)) for m, n in zip(move, vol.shape))]
        both = np.unique(one[one != two].astype(int) * 256 + two[one != two])
        pairs |= {p for v in both for p in (divmod(int(v), 256), divmod(int(v), 256)[::-1])}
    return pairs


def check(case, vol):
    """What is wrong, as text: pieces, closed layers, order and lengths of the crossings, the stored file."""
    bad = []
    label, count, _ = pieces(vol)
    for value, (name, wanted) in enumerate([("air", 1)] + [(name, wanted) for name, _, wanted in case.labels]):
        sizes = sorted(count[label == value].tolist(), reverse=True)
        if len(sizes) != wanted:
            bad.append(f"{name}: {len(sizes)} pieces {sizes[:8]}, wanted {wanted}")
    for one, two in sorted(touching(vol)):
        for inner, layer in case.closed:
            if case.names[one] == inner and case.names[two] != layer:
                bad.append(f"{inner} touches {case.names[two]}")
    for name, entry, target, wanted in case.paths:
        found, off = crossings(case, vol, entry, target)
        wanted = [re.fullmatch(r"(.*?)(?: ([\d.]+) ([\d.]+))?", part).groups() for part in wanted.split(", ")]
        if abs(off) > 0.3:
            bad.append(f"{name}: skin {off:+.2f} mm from the entry")
        if [f[0] for f in found] != [part[0] for part in wanted]:
            bad.append(f"{name}: crosses {[f[0] for f in found]}")
            continue
        for (layer, p, q), (_, least, most) in zip(found, wanted):
            if least and not float(least) <= q - p <= float(most):
                bad.append(f"{name}: {layer} {q - p:.2f} mm, wanted {least} to {most}")
    path = FOLDER / f"{case.name}.nrrd"
    head, _, body = (path.read_bytes() if path.exists() else b"").partition(b"\n\n")
    # The voxels count, not their packing, which differs between versions of zlib.
    if head != encode(case, vol[:1]).partition(b"\n\n")[0] or gzip.decompress(body) != vol.tobytes():
        bad.append(f"{path} is not what this script makes")
    return bad


def picture(case, vol, folder):
    """For every path: axial, coronal and sagittal slice through its target, radiological view, with a legend."""
    try:
        from PIL import Image, ImageDraw
    except ImportError:
        print("Pillow is missing: no pictures")
        return
    grid, zoom, white = case.grid, 5, (255, 255, 255)
    colours = np.array([(12, 12, 16)] + [c for _, c, _ in case.labels], np.uint8)
    Path(folder).mkdir(parents=True, exist_ok=True)
    for number, (name, entry, target, _) in enumerate(case.paths):
        a, b = (np.array([-p[0], -p[1], p[2]]) for p in (entry, target))
        i, j, k = (int(v) for v in np.floor((b - np.array(grid.low)) / grid.step))
        panels = []
        for title, cut, (h, v), marks in (("axial", vol[k], (0, 1), "RLAP"), ("coronal", vol[::-1, j], (0, 2), "RLSI"),
                                          ("sagittal", vol[::-1, :, i], (1, 2), "APSI")):
            image = Image.fromarray(colours[cut]).resize((cut.shape[1] * zoom, cut.shape[0] * zoom), 0)
            draw, (wide, high) = ImageDraw.Draw(image), image.size
            ends = []
            for p in (a + (a - b) * 6.0 / np.linalg.norm(a - b), b):
                up = (p[v] - grid.low[v]) / grid.step * zoom
                ends.append(((p[h] - grid.low[h]) / grid.step * zoom, high - up if v == 2 else up))
            draw.line(ends, fill=(0, 255, 0), width=2)
            draw.ellipse([ends[1][0] - 4, ends[1][1] - 4, ends[1][0] + 4, ends[1][1] + 4], outline=(0, 255, 0), width=2)
            for text, u, v in zip([title, *marks], (4, 4, wide - 12, wide // 2, wide // 2),
                                  (2, high // 2, high // 2, 2, high - 14)):
                draw.text((u, v), text, fill=white)
            panels.append(image)
        one, two, three = panels
        sheet = Image.new("RGB", (one.width + two.width + 10, one.height + three.height + 10), (40, 40, 44))
        for panel, place in ((one, (0, 0)), (two, (one.width + 10, 0)), (three, (0, one.height + 10))):
            sheet.paste(panel, place)
        draw, x, y = ImageDraw.Draw(sheet), max(one.width, three.width) + 30, one.height + 20
        draw.text((x, y), f"{case.name}: {name}", fill=white)
        for row, (text, colour, _) in enumerate(case.labels, 1):
            draw.rectangle([x, y + 20 * row, x + 14, y + 20 * row + 14], fill=colour)
            draw.text((x + 22, y + 20 * row + 1), f"{row} {text}", fill=white)
        sheet.save(Path(folder) / f"{case.name}_{number}.png")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--paths", action="store_true", help="print paths and crossings")
    parser.add_argument("--check", action="store_true", help="verify maps, paths and stored files")
    parser.add_argument("--picture", metavar="FOLDER", help="draw slices through the paths")
    parser.add_argument("names", nargs="*", help="cases, else all")
    args = parser.parse_args()
    failed = False
    for case in (case for case in CASES if not args.names or case.name in args.names):
        vol = build(case)
        if args.paths:
            print(path_text(case, vol))
        if args.picture:
            picture(case, vol, args.picture)
        if args.check:
            bad = check(case, vol)
            failed |= bool(bad)
            print("\n  ".join([f"{case.name}: " + ("wrong" if bad else "ok")] + bad))
        if not (args.paths or args.picture or args.check):
            data = encode(case, vol)
            FOLDER.mkdir(parents=True, exist_ok=True)
            (FOLDER / f"{case.name}.nrrd").write_bytes(data)
            print(f"{case.name}.nrrd: {vol.shape[::-1]} voxels, {len(data)} bytes")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
