// One run: what it does, its trends on one time axis, its decisions with what was seen.

import { chart, timePlace } from "./chart.js";
import { element, keep, setAttribute, setLines, setText } from "./dom.js";
import { oldMs, read, reasonOf, serviceNow } from "./api.js";
import { clock, code, duration, measured, number, percent, short, t } from "./text.js";
import {
  ageOf, conditionText, decidedAgo, feedReason, isAvailable, levelOf, limitBar, nameOf, otherRuns, paintBar, paintIcon, propertyOf, stateIcon, stateOf,
} from "./state.js";

/** Decisions that are kept and drawn. */
const MOST_DECISIONS = 2000;
const MOST_POINTS = 1500;
/** What the axis has beyond now, as a share of what was. */
const AHEAD = 0.04;

const facts = () => element("dl", { class: "facts" });

const setFacts = (list, entries) => {
  const flat = entries.filter(([, value]) => value !== null && value !== undefined);
  keep(
    list, flat, ([name]) => name,
    () => element("div", {}, element("dt"), element("dd")),
    (row, [name, value]) => {
      setText(row.firstChild, name);
      setText(row.lastChild, value);
    },
  );
};

const evidenceOf = (decision) => {
  const inputs = decision.inputs ?? {};
  const rules = inputs.rules ?? {};
  const property = rules.property;
  const process = inputs.process;
  if (!process) return null;
  const value = property === "PROCESS_PROPERTY_VIBRATION_FREQUENCY"
    ? process.line?.frequencyHz
    : property === "PROCESS_PROPERTY_VIBRATION_AMPLITUDE" ? process.line?.amplitude : process.maxDeviation;
  return { property, value, lower: rules.feed?.lower, upper: rules.feed?.upper, line: process.line };
};

/** A run by its name; `runs/7`. */
export const run = (place, store, name) => {
  // The machine that shows this run; none while it shows another one.
  let machine = null;
  let machineName = "";
  let record = null;
  let decisions = [];
  /** Of more decisions than are kept the newest are there. */
  let areCut = false;
  let selected = null;
  let failure = null;
  /** The decisions so far are read. */
  let areRead = false;
  const feeds = [];
  /** Feed overrides in force, of the time that this page is open. */
  const inForce = [];
  let toldAt = null;
  let isAsking = false;
  const stop = new AbortController();

  const icon = stateIcon();
  const title = element("h1", { class: "title" });
  const stateWord = element("span", { class: "state" });
  const subtitle = element("p", { class: "subtitle" }, element("span"), " ", element("a"));
  const notice = element("p", { class: "notice" });
  const reason = element("p", { class: "reason" });
  const process = element("div", { class: "process" }, element("span", { class: "process-text" }), limitBar());
  const overview = facts();
  const alarms = element("ul", { class: "alarms" });
  const trends = ["override", "property", "spindle", "feed"].map(() => chart());
  const timeline = element("div", { class: "timeline", role: "listbox", tabindex: "0" });
  const detail = element("section", { class: "detail", "aria-live": "polite" });
  const detailTitle = element("h3");
  const detailFacts = facts();
  detail.append(detailTitle, detailFacts);
  const trendTitle = element("h2");
  const decisionTitle = element("h2");
  const alarmTitle = element("h2");
  const body = element(
    "div", { class: "run", hidden: true },
    element("section", { class: "run-head" }, element("div", { class: "heading" }, icon, title, stateWord), subtitle, reason, process, overview),
    element("section", {}, alarmTitle, alarms),
    element("section", { class: "trends" }, trendTitle, ...trends.map((one) => one.root)),
    element("section", {}, decisionTitle, timeline, detail),
  );
  place.append(notice, body);

  const activity = () => (machine?.run?.run === name ? machine.run : record?.activity);
  const deviationUnit = () => activity()?.process?.deviationUnit || (record?.monitoring?.tool?.quantity === "SENSOR_QUANTITY_ACCELERATION" ? "mm/s²" : "mm");

  const drawHead = () => {
    const now = activity();
    const view = { ...machine, ...(now ?? {}), conditions: conditions(), machine: machine?.machine ?? "" };
    const state = stateOf(view);
    const available = isAvailable(view);
    setAttribute(body, "data-level", levelOf(view));
    paintIcon(icon, state);
    setText(title, now?.jobDisplayName || name);
    setText(stateWord, t(state));
    const kind = record.kind === "RUN_KIND_LIVE" ? t("live") : t("telemetryRun");
    const since = t("sinceTime", { time: clock(record.createTime) });
    const others = machine ? otherRuns(machine) : "";
    const age = now ? ageOf({ ...now, arrivedAt: machine?.arrivedAt ?? record.arrivedAt }, store) : "";
    setText(subtitle.firstChild, [machineName, kind, since, others, age].filter(Boolean).join(" · "));
    setText(subtitle.lastChild, record.job ? t("program") : "");
    setAttribute(subtitle.lastChild, "href", record.job ? `/${record.job}` : null);
    const overrides = available ? now?.overrides : undefined;
    setText(reason, overrides ? [feedReason(now), decidedAgo(now)].filter(Boolean).join(" · ") : "");
    const shown = available ? now?.process : undefined;
    setAttribute(process, "hidden", shown?.value === undefined);
    if (shown?.value !== undefined) {
      const limits = t("limits", { lower: measured(shown.lower, shown.unit), upper: measured(shown.upper, shown.unit), unit: shown.unit });
      setText(process.firstChild, `${propertyOf(shown)} ${measured(shown.value, shown.unit)} ${shown.unit} (${limits})`);
      paintBar(process.lastChild, shown);
    }
    const commanded = available ? now?.commanded : undefined;
    const speed = commanded?.spindleRevPerMin ?? now?.programmedRevPerMin;
    const line = shown?.line;
    setFacts(overview, [
      [t("override"), overrides ? percent(overrides.feed, 1) : "–"],
      [t("pathFeed"), commanded ? `${number(commanded.feedMmPerMin, 1)} mm/min` : "–"],
      [t("spindle"), speed === undefined || !overrides ? "–" : `${number(speed * overrides.spindle)} /min (${percent(overrides.spindle)})`],
      [t("progress"), now?.progress ? `${percent(now.progress.ratio)} · ${now.progress.remainingS === undefined ? "–" : `≈ ${duration(now.progress.remainingS)}`}` : null],
      [t("programLine"), commanded ? number(commanded.line) : null],
      [t("dominant"), line ? `${number(line.frequencyHz, 1)} Hz · ${measured(line.amplitude, shown.deviationUnit)} ${shown.deviationUnit}` : null],
    ]);
  };

  // Those of the log are told by the machine whichever run it shows.
  const conditions = () =>
    [...store.machines.values()].flatMap((one) => one.conditions ?? []).filter((one) => one.run === name);

  const drawAlarms = () => {
    const own = conditions();
    keep(
      alarms, own, (one) => `${one.code}-${one.decisionNumber ?? ""}`,
      () => element("li", {}, element("span", { class: "alarm-text" }), element("span", { class: "alarm-note" }), element("p", { class: "alarm-message", lang: "en" })),
      (row, one) => {
        setAttribute(row, "data-severity", short(one.severity, "CONDITION_SEVERITY_").toLowerCase());
        setText(row.firstChild, `${code(short(one.severity, "CONDITION_SEVERITY_"))}: ${conditionText(one)}`);
        setText(row.lastChild, one.message);
        const seen = !one.needsAcknowledgement ? "" : one.acknowledgedBy ? t("acknowledged", { name: one.acknowledgedBy }) : t("toAcknowledge");
        setText(row.children[1], [one.raiseTime ? t("sinceTime", { time: clock(one.raiseTime) }) : "", seen].filter(Boolean).join(" · "));
      },
    );
    // Before the machines are read nothing is known of it.
    const isTold = machine !== null || record.state !== "RUN_STATE_OPEN";
    const nothing = !store.isRead ? "loading" : isTold ? "noConditions" : "notShown";
    setText(alarmTitle, t(own.length > 0 ? "condition" : nothing));
  };

  /** Where the axis begins and ends, and where on it now is, while the run is open. */
  const times = () => {
    const begin = Date.parse(record.createTime);
    const isOpen = record.state === "RUN_STATE_OPEN";
    const end = isOpen ? serviceNow() : Date.parse(record.updateTime);
    const newest = Math.max(end, begin + 1000, ...decisions.slice(-1).map((one) => Date.parse(one.time)));
    return isOpen ? [begin, newest + AHEAD * (newest - begin), newest] : [begin, newest, undefined];
  };

  const drawTrends = () => {
    const [from, to, now] = times();
    const at = decisions.map((one) => [Date.parse(one.time), one]);
    // What was before the oldest decision that is kept is not known.
    const first = at.length > 0 ? [[areCut ? at[0][0] : from, at[0][1].inputs?.before]] : [];
    const present = activity();
    // Since its client left nobody knows what is in force.
    const until = record.state === "RUN_STATE_OPEN" && present && !isAvailable(present) && present.executionTime ? Date.parse(present.executionTime) : undefined;
    const steps = [...first, ...at.map(([time, one]) => [time, one.outcome?.after])];
    const bounds = record.monitoring?.rules?.feedBounds;
    // What was decided is in force when the machine reaches it: of what was not seen here only the decision is known.
    const begin = inForce.length > 0 ? inForce[0][0] : Infinity;
    const decided = steps.map(([time, after]) => [time, after?.feed]).filter(([time]) => time < begin);
    const overrideName = inForce.length === 0
      ? t("allDecided")
      : decided.length === 0 ? t("override") : t("overrideDecided", { time: clock(begin) });
    trends[0].draw(overrideName, {
      from, to, now, isStep: true, digits: 0, unit: "%", factor: 100, lower: bounds?.lower, upper: bounds?.upper,
      points: [...decided, ...inForce], until,
    });
    const seen = at.map(([time, one]) => [time, evidenceOf(one)]).filter(([, evidence]) => evidence);
    const rule = seen.at(-1)?.[1] ?? { lower: record.monitoring?.rules?.feed?.lower, upper: record.monitoring?.rules?.feed?.upper, property: record.monitoring?.rules?.property };
    const shownUnit = rule.property === "PROCESS_PROPERTY_VIBRATION_FREQUENCY" ? "Hz" : deviationUnit();
    trends[1].draw(propertyOf(rule), {
      from, to, now, digits: shownUnit === "mm" ? 4 : 1, unit: shownUnit, lower: rule.lower, upper: rule.upper,
      points: seen.map(([time, evidence]) => [time, evidence.value]),
    });
    trends[2].draw(t("spindleSpeed"), {
      from, to, now, isStep: true, digits: 0, unit: "/min", until,
      points: at.map(([time, one]) => [time, one.inputs?.currentRevPerMin ?? (one.inputs?.programmedRevPerMin ?? NaN) * (one.outcome?.after?.spindle ?? NaN)]),
    });
    trends[3].draw(t("pathFeed"), { from, to, now, digits: 0, unit: "mm/min", points: feeds });
    setText(trendTitle, t("trends"));
  };

  const drawDecisions = () => {
    const [from, to, now] = times();
    setAttribute(timeline, "data-open", now !== undefined);
    if (now !== undefined) timeline.style.setProperty("--now", timePlace(now, from, to));
    setText(decisionTitle, areCut
      ? t("decisionsLast", { count: MOST_DECISIONS, all: Number(decisions.at(-1).number) + 1 })
      : t(decisions.length > 0 ? "decisions" : areRead ? "noDecisions" : "loading"));
    setAttribute(timeline, "aria-label", t("decisions"));
    setAttribute(timeline, "hidden", decisions.length === 0);
    setAttribute(timeline, "data-dense", decisions.length > 100);
    keep(
      timeline, decisions, (one) => one.number,
      (one) => element("span", { class: "decision", role: "option", onclick: () => select(Number(one.number)) }),
      (mark, one) => {
        const outcome = one.outcome ?? {};
        mark.id = `decision-${one.number}`;
        mark.style.insetInlineStart = timePlace(Date.parse(one.time), from, to);
        setAttribute(mark, "data-action", short(outcome.action, "DECISION_ACTION_").toLowerCase());
        setAttribute(mark, "aria-selected", selected === Number(one.number) ? "true" : "false");
        setAttribute(mark, "aria-label", `${t("decision", { number: one.number })}: ${code(short(outcome.reason, "DECISION_REASON_"))}`);
      },
    );
    setAttribute(timeline, "aria-activedescendant", selected === null ? null : `decision-${selected}`);
    const one = decisions.find((decision) => Number(decision.number) === selected);
    setAttribute(detail, "hidden", !one);
    if (one) drawDetail(one);
  };

  const drawDetail = (one) => {
    const outcome = one.outcome ?? {};
    const evidence = evidenceOf(one);
    const inputs = one.inputs ?? {};
    const hold = short(outcome.holdReason, "HOLD_REASON_");
    const why = code(short(outcome.reason, "DECISION_REASON_"));
    const shownUnit = evidence?.property === "PROCESS_PROPERTY_VIBRATION_FREQUENCY" ? "Hz" : deviationUnit();
    const both = (overrides) => (overrides ? `${t("feed")} ${percent(overrides.feed, 1)} · ${t("spindle")} ${percent(overrides.spindle, 1)}` : "–");
    const bound = outcome.feedBound && outcome.feedBound !== "OVERRIDE_BOUND_UNSPECIFIED" ? ` (${t("bounds")})` : "";
    setText(detailTitle, t("decision", { number: one.number }));
    setFacts(detailFacts, [
      [t("time"), clock(one.time)],
      [t("action"), code(short(outcome.action, "DECISION_ACTION_"))],
      [t("reason"), hold && hold !== "UNSPECIFIED" ? `${why}: ${code(hold)}` : why],
      [t("seen"), evidence ? `${propertyOf(evidence)} ${measured(evidence.value, shownUnit)} ${shownUnit}` : inputs.unfit || inputs.silenceNs ? t("noEvidence") : null],
      [t("limit"), evidence ? t("limits", { lower: measured(evidence.lower, shownUnit), upper: measured(evidence.upper, shownUnit), unit: shownUnit }) : null],
      [t("dominant"), evidence?.line ? `${number(evidence.line.frequencyHz, 1)} Hz · ${measured(evidence.line.amplitude, deviationUnit())} ${deviationUnit()}` : null],
      [t("window"), one.span ? t("samples", { valid: number(one.span.valid), all: number(one.span.samples) }) : null],
      [t("before"), both(inputs.before)],
      [t("after"), both(outcome.after) + bound],
    ]);
  };

  const select = (number) => {
    selected = number;
    drawDecisions();
  };

  timeline.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1, Home: -Infinity, End: Infinity }[event.key];
    if (step === undefined || decisions.length === 0) return;
    event.preventDefault();
    const at = decisions.findIndex((one) => Number(one.number) === selected);
    // Without a selection an arrow begins at the newest one.
    const from = at < 0 ? decisions.length - 1 - step : at;
    const next = Number.isFinite(step) ? from + step : step < 0 ? 0 : decisions.length - 1;
    select(Number(decisions[Math.min(decisions.length - 1, Math.max(0, next))].number));
  });

  const draw = () => {
    setAttribute(notice, "hidden", record !== null && !failure);
    setLines(notice, [failure ? [t("failed", { reason: "" }), reasonOf(failure)] : [t("loading")]]);
    setAttribute(body, "hidden", record === null);
    if (!record) return;
    drawHead();
    drawAlarms();
    drawTrends();
    drawDecisions();
  };

  const note = (points, time, value) => {
    points.push([time, value]);
    if (points.length > MOST_POINTS) points.splice(0, points.length - MOST_POINTS);
  };

  const changed = () => {
    machine = [...store.machines.values()].find((one) => one.run?.run === name) ?? null;
    if (machine) machineName = nameOf(machine);
    const now = activity();
    if (now && isAvailable(now) && now.updateTime !== toldAt) {
      toldAt = now.updateTime;
      const time = Date.parse(now.updateTime);
      if (now.commanded) note(feeds, time, now.commanded.feedMmPerMin);
      const feed = now.overrides?.feed;
      if (feed !== undefined && inForce.at(-1)?.[1] !== feed) note(inForce, time, feed);
    }
    if (record) drawHead();
    if (record) drawAlarms();
  };

  const readDecisions = async () => {
    const after = decisions.length > 0 ? decisions.at(-1).sequence : "0";
    let token = "";
    do {
      const query = new URLSearchParams({ run: name, after, pageSize: "500", ...(token ? { pageToken: token } : {}) });
      const page = await read(`/v1/decisions?${query}`, stop.signal);
      add(page.decisions);
      token = page.nextPageToken;
    } while (token);
  };
  const add = (list) => {
    const known = new Set(decisions.map((one) => one.number));
    decisions.push(...list.filter((one) => one.run === name && !known.has(one.number)));
    decisions.sort((a, b) => Number(a.number) - Number(b.number));
    if (decisions.length <= MOST_DECISIONS) return;
    areCut = true;
    decisions = decisions.slice(-MOST_DECISIONS);
  };
  const readRecord = async () => {
    const now = await read(`/v1/${name}`, stop.signal);
    record = { ...now, arrivedAt: performance.now() - oldMs(now.activity?.updateTime) };
  };
  /** Asks for a run that no machine shows. */
  const ask = async () => {
    if (isAsking) return;
    isAsking = true;
    try {
      await readRecord();
      changed();
    } catch {
      // The connection says that it is lost; what was read last has its age.
    } finally {
      isAsking = false;
    }
  };
  const readAll = async () => {
    try {
      await readRecord();
      await readDecisions();
      areRead = true;
      failure = null;
    } catch (error) {
      if (stop.signal.aborted) return;
      failure = error;
    }
    changed();
    draw();
  };
  const subscriptions = [
    store.onChange(changed),
    store.onDecision((decision) => {
      if (decision.run !== name) return;
      add([decision]);
      draw();
    }),
    store.onReset(readAll),
    store.onJob((event) => {
      if (record && event.job === record.job) readAll();
    }),
  ];
  const tick = setInterval(() => {
    if (record?.state === "RUN_STATE_OPEN" && !machine) ask();
    if (record?.state === "RUN_STATE_OPEN") draw();
    const ended = activity() && ["EXECUTION_FINISHED", "EXECUTION_STOPPED"].includes(activity().execution);
    if (record?.state === "RUN_STATE_OPEN" && ended) readAll();
  }, 1000);
  // Charts are drawn for the width that they have.
  const resized = new ResizeObserver(() => record && drawTrends());
  resized.observe(trends[0].root);
  draw();
  readAll();
  return {
    draw,
    end: () => {
      stop.abort();
      resized.disconnect();
      clearInterval(tick);
      subscriptions.forEach((unsubscribe) => unsubscribe());
    },
  };
};
