"""The audit of recordings whose faults are known, because they were made here."""

import numpy as np
import pytest

from dior.errors import DiorError
from dior.ingest import audit, bags, frames
from dior.tables import tables
from tests.ingest.test_bags import T0, TOPIC, compressed, encoded, picture, write_bag

PERIOD = 33_333_333


def table(stamp_ns, lag_ms=4.0, bag="a.bag"):
    """Rows of a frames table, sorted by stamp as the frames step leaves them; `lag_ms` one or one per picture."""
    stamp_ns = np.asarray(stamp_ns, np.int64)
    receive = stamp_ns + np.round(np.asarray(lag_ms) * 1e6).astype(np.int64)
    order = np.argsort(stamp_ns, kind="stable")
    return {
        "stamp_ns": stamp_ns[order],
        "receive_ns": receive[order],
        "frame": np.arange(len(order)),
        "bag": np.full(len(order), bag, object),
        "restored_s": np.full(len(order), np.nan),
        "restored_sigma_s": np.full(len(order), np.nan),
    }


def audited(rows, repeated=()):
    mask = np.zeros(len(rows["frame"]), bool)
    mask[list(repeated)] = True
    return audit.audit(rows, mask)


def grid(count=300):
    return T0 + PERIOD * np.arange(count)


def test_a_clean_recording():
    done = audited(table(grid()))
    assert done.dropped == () and done.jumps == ()
    counts = ("lost", "gaps", "same_stamp", "same_picture", "out_of_order", "clock_jumps")
    assert [done.row[key] for key in counts] == [0] * 6
    assert done.row["nominal_hz"] == 30 and done.row["rate_hz"] == pytest.approx(30, abs=1e-5)
    assert done.row["lag_ms"] == 4 and done.row["jitter_ms"] < 1e-3 and abs(done.row["drift_ppm"]) < 1e-3
    assert audit.judge({**done.row, "looked_at": 12, "black": 0}, done, "a.bag") == []


def test_every_lost_picture_has_its_stamp_and_reason():
    lost = [40, 41, 42, 100, 200]
    kept = np.setdiff1d(np.arange(300), lost)
    lag = np.full(300, 5.0)
    lag[99:106] = [150, 0, 150, 120, 90, 60, 30]
    done = audited(table(grid()[kept], lag[kept]))
    assert done.row["lost"] == 5 and done.row["gaps"] == 3
    assert done.row["longest_gap_s"] == pytest.approx(4 * PERIOD / 1e9)
    assert [stamp for _, stamp, _ in done.dropped] == pytest.approx(grid()[lost], abs=2)
    assert [reason for *_, reason in done.dropped] == ["not_sent"] * 3 + ["recorder_behind"] + ["not_sent"]
    assert [frame for frame, *_ in done.dropped] == [39, 39, 39, 96, 195]
    [(severity, code, text)] = audit.judge({**done.row, "black": 0}, done, "a.bag")
    assert "1 of them while the recorder was behind" in text
    assert (severity, code) == ("info", "pictures_lost") and "5 pictures lost (1.7%) in 3 gaps" in text
    # of the whole recording, of which this may be a short part
    [(severity, *_)] = audit.judge({**done.row, "black": 0}, done, "a.bag", lost_share=0.031)
    assert severity == "warning"


@pytest.mark.parametrize("side", [99, 100])
@pytest.mark.parametrize(
    "late_periods, reason", [(1.9, "not_sent"), (2.1, "recorder_behind"), (3.5, "recorder_behind")]
)
def test_the_recorder_is_behind_where_a_picture_beside_the_gap_is_two_periods_late(side, late_periods, reason):
    kept = np.delete(grid(), 100)
    lag = np.full(299, 4.0)
    lag[side] += late_periods * PERIOD / 1e6
    assert [why for *_, why in audited(table(kept, lag)).dropped] == [reason]


@pytest.mark.parametrize("periods, missing", [(1.0, 0), (1.4, 0), (1.6, 1), (2.0, 1), (2.9, 2), (5.0, 4)])
def test_what_is_missing_where_the_bag_changes(periods, missing):
    """One picture less than periods between the last of one bag and the first of the next, at equal steps."""
    stamps = grid(40) + np.where(np.arange(40) >= 20, round((periods - 1) * PERIOD), 0)
    rows = table(stamps) | {"bag": np.repeat(np.array(["a.bag", "b.bag"], object), 20)}
    found = audit._between_bags(rows)
    wanted = stamps[19] + (stamps[20] - stamps[19]) * np.arange(1, missing + 1) // (missing + 1)
    assert [stamp for _, stamp, _ in found] == wanted.tolist()
    assert {(frame, why) for frame, _, why in found} <= {(19, "between_bags")}


def test_rate_jitter_lag_and_drift_are_those_put_in():
    rng = np.random.default_rng(0)
    jitter, lag = 1.5 * rng.standard_normal(3600), 6 + rng.exponential(2, 3600)
    ideal = T0 + np.round(np.arange(3600) / 29.97 * 1e9).astype(np.int64)
    seconds = (ideal - T0) / 1e9
    lag += 40e-3 * seconds
    lag[rng.choice(3600, 30, replace=False)] += 200
    done = audited(table(ideal + np.round(jitter * 1e6).astype(np.int64), lag))
    assert done.row["rate_hz"] == pytest.approx(29.97, rel=1e-5) and done.row["nominal_hz"] == 29.97
    assert done.row["jitter_ms"] == pytest.approx(1.5, rel=0.05)
    assert done.row["drift_ppm"] == pytest.approx(40, abs=3)
    assert 200 < done.row["lag_max_ms"] < 215
    assert done.row["lost"] == 0 and done.row["clock_jumps"] == 0


def test_a_late_stamp_is_no_lost_picture():
    late = grid()
    late[[50, 120, 121]] += np.array([7, 7, 6]) * PERIOD // 10
    assert audited(table(late)).row["lost"] == 0
    kept = np.delete(late, [49, 150, 200])
    done = audited(table(kept))
    assert done.row["lost"] == 3
    assert [stamp for _, stamp, _ in done.dropped] == pytest.approx(grid()[[49, 150, 200]], abs=2e5)


def test_the_simulated_clocks_are_found_as_they_were_made():
    """At the level `real`: late stamps and arrivals, drops and repeats. A drop at an end cannot be seen."""
    from dior.simulate import clocks, settings

    given = settings.from_dict({"preset": "real", "subjects": 1, "sequences": 1, "duration_s": 60.0})
    for walk in settings.sequences(given):
        for clock in clocks.clocks_of(given, walk)[0].values():
            stamp_ns = np.r_[clock.stamp_ns, clock.stamp_ns[clock.twice]]
            receive_ns = np.r_[clock.receive_ns, clock.receive_ns[clock.twice]]
            done = audited(table(stamp_ns, (receive_ns - stamp_ns) / 1e6))
            ticks = np.rint((clock.seconds - clock.seconds[0]) * given.fps)
            assert done.row["lost"] == np.ptp(ticks) + 1 - len(ticks) > 0
            assert done.row["same_stamp"] == clock.twice.sum()
            assert abs(done.row["drift_ppm"]) < 10 and done.row["rate_hz"] == pytest.approx(30, rel=1e-4)


def test_repeated_pictures_and_pictures_out_of_order():
    rows = table(np.r_[grid(), grid()[[7, 8]]])
    done = audited(rows, [8, 50])
    assert done.row["same_stamp"] == 2 and done.row["same_picture"] == 1 and done.row["lost"] == 0
    assert sorted(done.dropped) == [(8, grid()[7], "same_stamp"), (10, grid()[8], "same_stamp"),
                                    (50, int(rows["stamp_ns"][50]), "same_picture")]  # fmt: skip
    lag = np.full(300, 4.0)
    lag[20] = 50.0
    assert audited(table(grid(), lag)).row["out_of_order"] == 1


def test_restored_stamps_are_named_and_nothing_of_them_is_lost_or_jumps():
    rows = table(grid())
    rows["restored_s"][[*range(100, 120), 200]] = [0.6] * 20 + [-0.25]
    rows["restored_sigma_s"][[*range(100, 120), 200]] = [0.0005] * 20 + [0.002]
    done = audited(rows)
    assert done.row["restored"] == 21 and done.row["lost"] == 0 and done.jumps == ()
    [first, second] = audit.judge({**done.row, "black": 0}, done, "a.bag")
    assert first[:2] == second[:2] == ("warning", "stamps_restored")
    assert "a.bag: the header clock is 0.60 s early in frames 100 to 119 and nowhere else" in first[2]
    assert "to 0.5 ms" in first[2] and "0.25 s late in frame 200" in second[2]


@pytest.mark.parametrize("back_s", [1.1, 2.5])
def test_a_clock_that_is_set_back_by_more_than_a_second_between_bags_is_refused(back_s):
    receive = grid()
    stamps = receive - np.where(np.arange(300) >= 150, round((back_s + PERIOD / 1e9) * 1e9), 0)
    order = np.argsort(stamps, kind="stable")
    with pytest.raises(
        DiorError, match=f"walk, cam01: the header clock was set back by {back_s:.1f} s after picture 149"
    ):
        frames.check_usable(stamps[order], receive[order], "walk, cam01")


def test_a_clock_that_jumps_forward_is_an_error_and_nothing_is_lost():
    shifted = grid() + np.where(np.arange(300) > 149, 5 * 10**9, 0)
    rows = table(shifted, 4.0 - np.where(np.arange(300) > 149, 5000.0, 0))
    done = audited(rows)
    assert done.row["clock_jumps"] == 1 and done.row["lost"] == 0 and done.jumps[0][0] == 149
    codes = {code: severity for severity, code, _ in audit.judge({**done.row, "black": 0}, done, "a.bag")}
    assert codes["clock_jump"] == "error"
    pause = audited(table(np.r_[grid(150), grid(150) + 10 * 10**9]))
    assert pause.row["clock_jumps"] == 0 and pause.row["lost"] == 150


@pytest.mark.parametrize(
    ("stamp_ns", "lag_ms", "text"),
    [
        ([T0], 4.0, "walk, cam01: 1 picture is no recording"),
        ([0, 0, 0, T0], 4.0, "3 of 4 header stamps are zero, so the driver did not"),
        ([T0] * 5, np.arange(5), "all 5 header stamps are the same"),
        (T0 + 10**9 * np.array([5, 6, 7, 1, 2, 3]), 1e3 * np.array([4, 4, 4, 11, 11, 11]), "set back by 6.0 s after p"),
        (T0 + PERIOD * np.array([1, 0, 3, 2, 5, 4]), np.array([4, 50] * 3) + 40.0, "earlier than the one before"),
    ],
)
def test_stamps_that_cannot_be_used(stamp_ns, lag_ms, text):
    rows = table(stamp_ns, lag_ms)
    with pytest.raises(DiorError, match=text):
        frames.check_usable(rows["stamp_ns"], rows["receive_ns"], "walk, cam01")


def test_the_step_on_two_bags_with_a_gap_a_frozen_and_a_black_camera(tmp_path):
    def message(i, grey, topic=TOPIC):
        stamp = T0 + PERIOD * i
        return topic, stamp + 4_000_000, compressed(stamp, encoded(picture(grey) // (grey > 0 or 255)))

    other = "/cam02/image"
    first = [message(i, 20 + (i if i not in (5, 6) else 4)) for i in range(10)]
    first += [message(i, 30 + i % 2, other) for i in range(10)]
    second = [message(i, 20 + i) for i in range(13, 20)] + [message(i, 0, other) for i in range(10, 20)]
    paths = [write_bag(tmp_path / f"{name}.bag", part) for name, part in (("a", first), ("b", second))]
    frames.run(sequence="walk", bags=paths, data_root=tmp_path, topics={"cam01": TOPIC, "cam02": other},
               out=tmp_path / "frames.parquet")  # fmt: skip
    given = {"sequence": "walk", "frames": tmp_path / "frames.parquet", "data_root": tmp_path}
    for run in "xy":
        outputs = {key: tmp_path / f"{run}.{key}.parquet" for key in ("out", "out_dropped", "findings")}
        audit.run(**given, **outputs)
    for key in ("out", "out_dropped", "findings"):
        assert (tmp_path / f"x.{key}.parquet").read_bytes() == (tmp_path / f"y.{key}.parquet").read_bytes()
    found = tables.read(tmp_path / "x.out.parquet", "stamp_audit")
    assert list(zip(found["camera"], found["bag"], found["pictures"].tolist(), strict=True)) == [
        ("cam01", "a.bag", 10), ("cam01", "b.bag", 7), ("cam02", "a.bag", 10), ("cam02", "b.bag", 10),
    ]  # fmt: skip
    assert found["same_picture"].tolist() == [2, 0, 0, 9] and found["lost"].tolist() == [0] * 4
    assert found["black"].tolist()[:3] == [0, 0, 0] and found["black"][3] == found["looked_at"][3] > 4
    dropped = tables.read(tmp_path / "x.out_dropped.parquet", "dropped_frames")
    of_first = tables.of_camera(dropped, "cam01")
    assert of_first["reason"].tolist() == ["same_picture"] * 2 + ["between_bags"] * 3
    assert of_first["frame"].tolist() == [5, 6, 9, 9, 9]
    scopes = tables.read(tmp_path / "x.findings.parquet", "findings")
    assert ("walk/cam02", "black_pictures") in set(zip(scopes["scope"], scopes["code"], strict=True))


def test_repeated_needs_the_same_bytes_to_the_end(tmp_path):
    """Uncompressed pictures that differ in their last row only."""
    from tests.ingest.test_bags import TYPES, header

    images = [np.zeros((100, 100, 3), np.uint8) for _ in range(4)]
    images[2][-1, -1] = 7
    messages = [
        ("/i", T0 + i, TYPES["sensor_msgs/msg/Image"](header=header(T0 + i), height=100, width=100, encoding="bgr8",
                                                       is_bigendian=0, step=300, data=image.ravel()))
        for i, image in enumerate(images)
    ]  # fmt: skip
    bag = write_bag(tmp_path / "a.bag", messages)
    assert bags.repeated(bag, ["/i"]) == {("/i", T0 + 1, 0)}


def test_the_real_recording_is_regular(shared, tmp_path):
    root = shared / "real_outdoor"
    frames.run(sequence="beam", bags=[root / "pc1.bag"], data_root=root, out=tmp_path / "frames.parquet",
               topics={"cam01": "/cam01/color/image_raw/compressed"})  # fmt: skip
    audit.run(sequence="beam", frames=tmp_path / "frames.parquet", data_root=root, out=tmp_path / "a.parquet",
               out_dropped=tmp_path / "d.parquet", findings=tmp_path / "f.parquet")  # fmt: skip
    found = tables.read(tmp_path / "a.parquet", "stamp_audit")
    assert found["pictures"].tolist() == [100] and found["rate_hz"][0] == pytest.approx(60) and found["lag_ms"][0] == 4
    assert not len(tables.read(tmp_path / "d.parquet", "dropped_frames")["camera"])
    assert not len(tables.read(tmp_path / "f.parquet", "findings")["scope"])
