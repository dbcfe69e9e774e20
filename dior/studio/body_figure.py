"""Where the markers of Plug-in-Gait sit, in words and on a drawn body seen from its front and its back.

The drawing is 100 wide and 220 high, its middle at 50; the subject's left is to the right of the front view and to the
left of the back view. Where markers sit: Vicon, Plug-in Gait Reference Guide, "Full body modeling".
"""

from dior.body import names

# part of a name without its side: words, and where it is drawn: x from the middle to the subject's left, y from above,
# on the front (F), the back (B) or both
_PAIRED = {
    "FHD": ("front of the head, over the temple", 9, 14, "F"),
    "BHD": ("back of the head, at the height of the front ones", 8, 14, "B"),
    "SHO": ("top of the shoulder", 22, 45, "FB"),
    "UPA": ("outer side of the upper arm", 29, 62, "FB"),
    "ELB": ("outer side of the elbow", 32, 80, "FB"),
    "FRM": ("outer side of the forearm", 34, 92, "FB"),
    "WRA": ("wrist, on the side of the thumb", 31, 106, "F"),
    "WRB": ("wrist, on the side of the little finger", 37, 107, "FB"),
    "FIN": ("back of the hand, below the middle finger's knuckle", 36, 117, "FB"),
    "ASI": ("front of the pelvis, on the bone", 11, 98, "F"),
    "PSI": ("back of the pelvis, beside the spine", 6, 95, "B"),
    "THI": ("outer side of the thigh", 17, 128, "FB"),
    "KNE": ("outer side of the knee", 16, 150, "FB"),
    "TIB": ("outer side of the shank", 15, 172, "FB"),
    "ANK": ("outer side of the ankle", 14, 196, "FB"),
    "HEE": ("heel", 10, 204, "B"),
    "TOE": ("foot, behind the second toe", 14, 211, "F"),
}
_MIDDLE = {
    "C7": ("spine, where the neck begins", 0, 38, "B"),
    "T10": ("spine, in the middle of the back", 0, 68, "B"),
    "CLAV": ("upper end of the breastbone", 0, 44, "F"),
    "STRN": ("lower end of the breastbone", 0, 63, "F"),
    "RBAK": ("right shoulder blade; there is none on the left", -12, 55, "B"),
}
# before a pose is known: what is told apart at a glance; head, hands and feet first, as a pose wants marks apart
EASY = (
    "LFHD RFHD LWRB RWRB LTOE RTOE LBHD RBHD C7 CLAV LSHO RSHO LELB RELB LKNE RKNE LANK RANK LWRA RWRA LHEE RHEE"
).split()


def words(name: str) -> str:
    """Where a marker sits, "" for one that Plug-in-Gait does not have."""
    found = _place(name)
    side = names.side_of(name)
    return "" if found is None else found[0] if side == "middle" else f"{side} {found[0]}"


def drawn() -> dict[str, list[tuple[str, float, float]]]:
    """(marker, x, y) of the views `front` and `back`."""
    views: dict[str, list[tuple[str, float, float]]] = {"front": [], "back": []}
    for name in names.PLUG_IN_GAIT_39:
        found = _place(name)
        assert found is not None
        _, x, y, seen = found
        left = -x if names.side_of(name) == "right" else x
        for view, letter, way in (("front", "F", 1), ("back", "B", -1)):
            if letter in seen:
                views[view].append((name, 50 + way * left, y))
    return views


def _place(name: str) -> tuple[str, float, float, str] | None:
    if name in _MIDDLE:
        return _MIDDLE[name]
    return _PAIRED.get(name[1:]) if name in names.PLUG_IN_GAIT_39 else None
