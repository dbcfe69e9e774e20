"""The same markers as Qualisys Track Manager, Motive and OpenSim write them in text: written here, from public readers
of such files, as none of the programs was at hand."""

import numpy as np


def _cell(value, digits):
    return "" if np.isnan(value) else f"{value:.{digits}f}"


def _rows(points, digits):
    return [[_cell(value, digits) for value in row] for row in points.reshape(len(points), -1)]


def qtm(path, labels, points, rate=100.0, first=1, columns=True, zeros=True, more=()):
    """`points` (F, N, 3) m, Z up. `columns`: with frame, time and the row of their names; `zeros`: what is missing is
    0; `more`: further lines of the header."""
    header = [
        ["NO_OF_FRAMES", len(points)], ["NO_OF_CAMERAS", 8], ["NO_OF_MARKERS", len(labels)], ["FREQUENCY", f"{rate:g}"],
        ["NO_OF_ANALOG", 0], ["ANALOG_FREQUENCY", 0], ["DESCRIPTION", "--"],
        ["TIME_STAMP", "2024-02-15, 12:00:00.123", "1234.5"], ["DATA_INCLUDED", "3D"], *more, ["MARKER_NAMES", *labels],
    ]  # fmt: skip
    rows = _rows(np.nan_to_num(1000 * points) if zeros else 1000 * points, 3)
    if columns:
        header.append(["Frame", "Time", *(f"{label} {axis}" for label in labels for axis in "XYZ")])
        rows = [[first + i, f"{i / rate:.5f}", *row] for i, row in enumerate(rows)]
    path.write_text("".join("\t".join(map(str, row)) + "\n" for row in [*header, *rows]))
    return path


def motive(path, labels, points, rate=100.0, first=1, unit="Meters", solved=True, timecode=False, up="y"):
    """`points` (F, N, 3) m, Z up. `solved`: with what Motive solves beside, which is something else."""
    turned = points @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]).T if up == "y" else points
    rows = _rows(turned * {"Meters": 1, "Millimeters": 1000, "Centimeters": 100}[unit], 6)
    kinds, names = (["Marker"] * 3 * len(labels), [label for label in labels for _ in range(3)])
    positions, axes = ["Position"] * len(kinds), ["X", "Y", "Z"] * len(labels)
    if solved:
        kinds, names = [*["Bone"] * 7, *["Bone Marker"] * 3, *kinds], [*["S01:Hip"] * 7, *[labels[0]] * 3, *names]
        positions = [*["Rotation"] * 4, *["Position"] * 6, *positions]
        axes, rows = [*"XYZW", *"XYZ", *"XYZ", *axes], [["0.5"] * 10 + row for row in rows]
    lead = [""] * timecode
    head = {
        "Format Version": "1.23", "Take Name": "walk 3", "Take Notes": "", "Capture Frame Rate": f"{rate:.6f}",
        "Export Frame Rate": f"{rate:.6f}", "Capture Start Time": "2024-02-15 12.00.00.000 PM",
        "Total Frames in Take": len(points) + 50, "Total Exported Frames": len(points), "Rotation Type": "Quaternion",
        "Length Units": unit, "Coordinate Space": "Global",
    }  # fmt: skip
    lines = [
        [cell for pair in head.items() for cell in pair], [], ["", "Type", *lead, *kinds], ["", "Name", *lead, *names],
        ["", "ID", *lead, *['"4CF0B31A5A5411EF"'] * len(kinds)], ["", "", *lead, *positions],
        ["Frame", "Time (Seconds)", *["TimeCode"] * timecode, *axes],
        *[[first - 1 + i, f"{i / rate:.6f}", *["15:26:46:12.02"] * timecode, *row] for i, row in enumerate(rows)],
    ]  # fmt: skip
    path.write_text("".join(",".join(map(str, row)) + "\r\n" for row in lines))
    return path


def trc(path, labels, points, rate=100.0, first=1, unit="mm", up="y"):
    """`points` (F, N, 3) m, Z up."""
    turned = points @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]).T if up == "y" else points
    names = "DataRate CameraRate NumFrames NumMarkers Units OrigDataRate OrigDataStartFrame OrigNumFrames".split()
    values = [f"{rate:g}", f"{rate:g}", len(points), len(labels), unit, f"{rate:g}", first, len(points)]
    rows = _rows(turned * (1000 if unit == "mm" else 1), 6)
    lines = [
        ["PathFileType", "4", "(X/Y/Z)", path.name], names, values,
        ["Frame#", "Time", *(cell for label in labels for cell in (label, "", ""))],
        ["", "", *(f"{axis}{i}" for i in range(1, len(labels) + 1) for axis in "XYZ")], [],
        *[[first + i, f"{i / rate:.6f}", *row] for i, row in enumerate(rows)],
    ]  # fmt: skip
    path.write_text("".join("\t".join(map(str, row)) + "\n" for row in lines))
    return path
