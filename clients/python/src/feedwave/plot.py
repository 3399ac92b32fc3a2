"""Pictures of plans and reports, for notebooks and files (`pip install feedwave[plot]`).

Every function answers with a `Picture`: a notebook shows it, `save` writes it as PNG, SVG or PDF, `figure` is matplotlib's.
"""

from __future__ import annotations

import io
import os
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from ._extras import extra
from .errors import SourceError
from .events import Decision
from .setpoints import Floats, Setpoints
from .v1 import lobes_pb2, report_pb2, thread_report_pb2

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Colours that can be distinguished without seeing red or green, the same as in the pictures of the commands.
COMMAND, VIBRATION, MUTED, GOOD, BAD = "#0064aa", "#cd5500", "#828d9c", "#00946c", "#820046"
# Revolutions of a picture of the chip, and its points in a revolution: enough for a hundred vibrations.
REVOLUTIONS, POINTS_PER_REVOLUTION = 4, 1_440
# Earlier revolutions that are looked at where a report does not say how many can be seen.
EARLIER_REVOLUTIONS = 64


class Picture:
    """A picture."""

    def __init__(self, figure: Figure) -> None:
        """Shows a figure of matplotlib."""
        self.figure = figure

    def save(self, path: str | os.PathLike[str], **options: Any) -> None:
        """Writes it into a file, whose name says the format; `options` are those of matplotlib's `savefig`."""
        self.figure.savefig(os.fspath(path), **options)

    def _repr_png_(self) -> bytes:
        data = io.BytesIO()
        self.figure.savefig(data, format="png", dpi=80)
        return data.getvalue()


def _figure(width: float, height: float) -> Figure:
    # Without pyplot: no figure of its own is kept behind the caller's back.
    figure: Figure = _matplotlib("figure").Figure(figsize=(width, height), layout="constrained")
    return figure


def _matplotlib(module: str) -> Any:
    return extra(f"matplotlib.{module}", "plot", "pictures")


def _panel(figure: Figure, place: tuple[int, int, int], title: str, x: str, y: str) -> Axes:
    axes = figure.add_subplot(*place)
    axes.set_title(title, fontsize="medium")
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(visible=True, alpha=0.3)
    return axes


def path(setpoints: Setpoints) -> Picture:
    """The path of the tool, coloured by the commanded feed: X over Z on lathes (X is a radius), Y over X on mills.

    Raises:
        SourceError: for setpoints without two linear axes or without the feed.
    """
    pairs = [("Z_mm", "X_mm"), ("X_mm", "Y_mm")]
    pair = next((pair for pair in reversed(pairs) if all(name in setpoints for name in pair)), None)
    if pair is None or "feed_mm_per_min" not in setpoints:
        raise SourceError(f"a path needs Z and X, or X and Y, and the feed: there are {', '.join(setpoints)}")
    across, up = (setpoints[name] for name in pair)
    figure = _figure(8, 5)
    axes = _panel(figure, (1, 1, 1), "path", f"{pair[0][0]}, mm", f"{pair[1][0]}, mm")
    points = np.column_stack([across, up])
    lines = _matplotlib("collections").LineCollection(np.stack([points[:-1], points[1:]], axis=1).tolist(), cmap="viridis", linewidths=1.5)
    feeds = setpoints["feed_mm_per_min"][1:]
    lines.set_array(feeds)
    _, highest = _legible(feeds)
    lines.set_clim(0, highest)
    axes.add_collection(lines)
    axes.autoscale()
    axes.set_aspect("equal", adjustable="datalim")
    figure.colorbar(lines, ax=axes, label="feed, mm/min", extend="max" if feeds.max(initial=0.0) > highest else "neither")
    return Picture(figure)


def feed(setpoints: Setpoints) -> Picture:
    """The commanded feed over time, and the velocity of each axis; shaded where the tool vibrates along the path."""
    velocities = [name for name in setpoints.layout.axes if setpoints.count > 1]
    rows = 1 + len(velocities)
    figure = _figure(9, 1.2 + 1.6 * rows)
    time_s = setpoints.time_s
    axes = _panel(figure, (rows, 1, 1), "", "", "feed, mm/min")
    axes.plot(time_s, setpoints["feed_mm_per_min"], color=COMMAND, linewidth=1.2)
    _show(axes, setpoints["feed_mm_per_min"])
    vibrates = setpoints["vibration_offset_mm"] != 0.0 if "vibration_offset_mm" in setpoints else np.zeros(setpoints.count, bool)
    axes.fill_between(time_s, 0, 1, where=_closed(vibrates), transform=axes.get_xaxis_transform(), color=VIBRATION, alpha=0.15, label="vibrating")
    if vibrates.any():
        axes.legend(loc="upper right")
    minutes = setpoints.layout.period_us / 6e7
    for row, name in enumerate(velocities, 2):
        axis, unit = name.rsplit("_", 1)
        axes = _panel(figure, (rows, 1, row), "", "", f"{axis}, {unit}/min")
        velocity = np.diff(setpoints[name]) / minutes
        axes.plot(time_s[1:], velocity, color=MUTED, linewidth=0.8)
        _show(axes, velocity)
    axes.set_xlabel("time, s")
    return Picture(figure)


def _legible(values: Floats) -> tuple[float, float]:
    """What is shown of values: all, unless a few (rapid moves) would hide the others."""
    if not len(values):
        return 0.0, 1.0
    size = np.abs(values)
    most = float(np.percentile(size, 90))
    if size.max() > 5.0 * most > 0.0:
        values = values[size <= 2.0 * most]
    return float(values.min()), float(values.max())


def _show(axes: Axes, values: Floats) -> None:
    low, high = _legible(values)
    space = 0.1 * (high - low) or 1.0
    axes.set_ylim(low - space, high + space)
    if len(values) and (values.max() > high or values.min() < low):
        axes.set_title("rapid moves go beyond", fontsize="small", loc="right")


def _closed(vibrates: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> list[bool]:
    """Without the single setpoints at which the wave passes through zero."""
    closed = vibrates.copy()
    closed[1:-1] |= vibrates[:-2] & vibrates[2:]
    found: list[bool] = closed.tolist()
    return found


def chip_thickness_mm(chip: report_pb2.ChipReport, amplitude_mm: float, revolutions: Floats) -> Floats:
    """Uncut chip thickness over the spindle angle in revolutions, mm; 0 or less where the tool cuts air (docs/functions/path-vibration.md,
    "Will the chip break?")."""
    phase = 2 * np.pi * chip.vibrations_per_rev * revolutions
    thickness = np.full_like(phase, np.inf)
    for earlier in range(1, (chip.earlier_revolutions or EARLIER_REVOLUTIONS) + 1):
        shift = np.pi * earlier * chip.vibrations_per_rev
        seen = earlier * chip.feed_mm_per_rev + 2 * amplitude_mm * np.sin(shift) * np.cos(phase - shift)
        np.minimum(thickness, seen, out=thickness)
    return thickness


def chip(*sections: report_pb2.SectionReport) -> Picture:
    """The chip of vibrating sections around the revolution, beside each other and to one scale: where the thickness is 0, it breaks.

    Raises:
        SourceError: for a section in which nothing is cut with a turning spindle.
    """
    if not sections or not all(section.HasField("chip") for section in sections):
        raise SourceError("a picture of the chip needs sections that are cut with a turning spindle")
    figure = _figure(4.5 * len(sections) + 1.5, 4)
    revolutions = np.linspace(0, REVOLUTIONS, REVOLUTIONS * POINTS_PER_REVOLUTION + 1)
    panels = []
    for place, section in enumerate(sections, 1):
        cut = section.chip
        verdict = "breaks" if cut.broken else "does not break"
        title = f"{section.frequency_hz:g} Hz at {cut.spindle_rev_per_min:g} rev/min: the chip {verdict}"
        axes = _panel(figure, (1, len(sections), place), title, "spindle angle, revolutions", "chip thickness, mm")
        thickness = chip_thickness_mm(cut, section.amplitude_mm, revolutions)
        axes.plot(revolutions, thickness, color=COMMAND, linewidth=1.4)
        axes.fill_between(revolutions, 0, np.maximum(thickness, 0), color=COMMAND, alpha=0.2, label="material cut")
        axes.fill_between(revolutions, 0, np.minimum(thickness, 0), color=VIBRATION, alpha=0.6, label="air: the chip is cut through")
        panels.append(axes)
    lowest = min(axes.get_ylim()[0] for axes in panels)
    highest = max(axes.get_ylim()[1] for axes in panels)
    for axes in panels:
        axes.set_ylim(min(lowest, 0.0), highest)
    panels[0].legend(loc="upper right", fontsize="small")
    return Picture(figure)


def thread(section: thread_report_pb2.ThreadSectionReport | thread_report_pb2.Thread) -> Picture:
    """The depth of the tip in every pass of a thread over the spindle angle: where a pass is not deeper than all before it in the same groove,
    its chip is cut through (docs/functions/thread-vibration.md, "Chip report per pass")."""
    planned = section.thread if isinstance(section, thread_report_pb2.ThreadSectionReport) else section
    # At the same place on the work: revolutions between the passes count where D is no whole number.
    judged = section.report.passes if isinstance(section, thread_report_pb2.ThreadSectionReport) else []
    figure = _figure(9, 5)
    axes = _panel(figure, (1, 1, 1), "depth of the tip", "spindle angle on the work, degrees", "depth on the radius, mm")
    angle_deg = np.linspace(0, 720, 2 * POINTS_PER_REVOLUTION + 1)
    grooves: dict[int, Floats] = {}
    for number, cut in enumerate(planned.passes, 1):
        before = grooves.get(cut.start, np.zeros_like(angle_deg))
        shift_deg = judged[number - 1].work_phase_shift_deg if judged else cut.phase_shift_deg
        phase = np.radians(planned.vibrations_per_rev * angle_deg - shift_deg)
        depth = np.asarray(cut.depth_mm - 0.5 * cut.amplitude_mm * (1 - np.cos(phase)), dtype=np.float64)
        (line,) = axes.plot(angle_deg, depth, linewidth=1.3, label=f"pass {number}")
        axes.fill_between(angle_deg, before, np.maximum(before, depth), color=line.get_color(), alpha=0.15)
        grooves[cut.start] = np.maximum(before, depth)
    axes.invert_yaxis()
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize="small")
    return Picture(figure)


def decisions(made: Iterable[Decision]) -> Picture:
    """The deviation that each window of a run showed (unit of the monitoring: mm for displacements), with the limits of its feed rule, and the
    feed override that followed."""
    judged = [decision for decision in made if decision.deviation is not None]
    figure = _figure(9, 5)
    time_s = [decision.time_s for decision in judged]
    axes = _panel(figure, (2, 1, 1), "", "", "deviation")
    axes.plot(time_s, [decision.deviation or 0.0 for decision in judged], color=COMMAND, marker=".", linewidth=0.8)
    for decision in judged[:1]:
        rule = decision.proto.inputs.rules.feed
        for limit, name in ((rule.lower, "lower limit"), (rule.upper, "upper limit")):
            axes.axhline(limit, color=BAD, linestyle="--", linewidth=1.0, label=f"{name} {limit:g}")
        axes.legend(loc="upper right", fontsize="small")
    axes.set_ylim(bottom=0.0)
    axes = _panel(figure, (2, 1, 2), "", "time of the sensors, s", "feed override, %")
    axes.step(time_s, [100 * decision.feed for decision in judged], where="post", color=VIBRATION)
    axes.set_ylim(bottom=0.0)
    return Picture(figure)


def lobes(stability: lobes_pb2.StabilityLobes) -> Picture:
    """The limit of stability over the spindle speed, with the best speed of each band."""
    figure = _figure(9, 5)
    depth = "axial depth, mm" if stability.HasField("radial_immersion") else "width of cut, mm"
    axes = _panel(figure, (1, 1, 1), "limit of stability", "spindle speed, rev/min", depth)
    speeds = np.array([point.spindle_rev_per_min for point in stability.chart])
    limits = np.array([point.limit_mm if point.HasField("limit_mm") else np.nan for point in stability.chart])
    margin = stability.search.margin
    stable = [pocket.stable_mm for pocket in stability.pockets if pocket.HasField("stable_mm")]
    # Peaks beyond the deepest speed of the table are cut off.
    top = max([1.3 * depth_mm / max(1.0 - margin, 1e-6) for depth_mm in stable] + [2.5 * stability.least_limit_mm, 1e-6])
    axes.plot(speeds, limits, color=BAD, linewidth=1.6, label="limit: chatter above")
    shown = np.nan_to_num(limits, nan=top) * (1.0 - margin)
    axes.fill_between(speeds, 0, np.minimum(shown, top), color=GOOD, alpha=0.15, label=f"stable with the margin of {100 * margin:.0f} %")
    labelled = -np.inf
    for number, pocket in enumerate(stability.pockets):
        speed = pocket.band.spindle_rev_per_min
        depth_mm = pocket.stable_mm if pocket.HasField("stable_mm") else top
        axes.plot([speed, speed], [0, depth_mm], color=COMMAND, marker="o", markevery=[1], label="" if number else "best speed of its band")
        if speed - labelled > 0.04 * (speeds[-1] - speeds[0]):
            axes.annotate(f"{speed:.0f}", (speed, 0), textcoords="offset points", xytext=(3, 3), fontsize="small")
            labelled = speed
    axes.set_ylim(0, top)
    axes.legend(loc="upper left", fontsize="small")
    return Picture(figure)
