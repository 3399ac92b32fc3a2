// What a machine does, in words, colours and shapes. Normal is quiet: only exceptions have a colour.

import { oldMs } from "./api.js";
import { clock, code, duration, measured, short, t } from "./text.js";
import { element, setAttribute, setText } from "./dom.js";

const WORDS = {
  IDLE: "idle", READY: "ready", RUNNING: "running", HELD: "held", STOPPED: "stopped", FINISHED: "done", FAULT: "fault",
  INTERRUPTED: "interrupted",
};

/** Shapes that tell states apart without colour, in a square of 24. */
const SHAPES = {
  idle: "M4 12h16", ready: "M12 4a8 8 0 1 0 .01 0", running: "M7 4l13 8-13 8z", held: "M6 4h4v16H6zM14 4h4v16h-4z",
  stopped: "M5 5h14v14H5z", done: "M4 13l5 5L20 6", fault: "M12 3l10 18H2zM12 10v5M12 18v.5",
  interrupted: "M4 12h5M15 12h5M10 7l4 10", noData: "M5 5l14 14M19 5L5 19",
};
const FILLED = new Set(["running", "held", "stopped"]);

/** The state as a word: a key of the texts. */
export const stateOf = (machine) => WORDS[short(machine.execution, "EXECUTION_")] ?? "noData";

export const isAvailable = (machine) => machine.availability === "AVAILABILITY_AVAILABLE";

const severities = (machine) => machine.conditions ?? [];

/** How much attention a machine needs: `fault`, `hold`, `warning`, `gone` or `normal`. */
export const levelOf = (machine) => {
  const conditions = severities(machine);
  const state = stateOf(machine);
  if (state === "fault" || conditions.some((one) => one.severity === "CONDITION_SEVERITY_FAULT")) return "fault";
  if (state === "held" || state === "stopped") return "hold";
  const warns = conditions.some((one) => one.severity === "CONDITION_SEVERITY_WARNING" && one.code !== "FINDINGS");
  if (warns && isAvailable(machine)) return "warning";
  return state === "interrupted" ? "gone" : "normal";
};

/** Whether somebody has to act: a condition that nobody has acknowledged. */
export const isUnacknowledged = (machine) =>
  severities(machine).some((one) => one.needsAcknowledgement && !one.acknowledgeTime);

/** An icon for a state; `paint` changes it. */
export const stateIcon = () =>
  element("svg", { class: "icon", viewBox: "0 0 24 24", "aria-hidden": "true", focusable: "false" }, element("path"));

export const paintIcon = (icon, state) => {
  setAttribute(icon.firstChild, "d", SHAPES[state] ?? SHAPES.noData);
  setAttribute(icon, "data-filled", FILLED.has(state));
};

/** The name of a machine for people. */
export const nameOf = (machine) => machine.displayName || machine.machine.replace("machines/", "");

/** How many runs a machine has besides the one that is shown, in words; empty where it has none. */
export const otherRuns = (machine) =>
  !machine.otherRuns ? "" : machine.otherRuns === 1 ? t("otherRun") : t("otherRuns", { count: machine.otherRuns });

/** The name of the process property. */
export const propertyOf = (process) =>
  t({
    PROCESS_PROPERTY_VIBRATION_AMPLITUDE: "amplitude",
    PROCESS_PROPERTY_VIBRATION_FREQUENCY: "frequency",
  }[process.property] ?? "deviation");

/** A condition in words: what, and the numbers. */
export const conditionText = (condition) => {
  const what = code(condition.code);
  if (condition.value === undefined || condition.limit === undefined) return what;
  const relation = condition.value > condition.limit ? ">" : "<";
  const numbers = [condition.value, condition.limit].map((value) => measured(value, condition.unit));
  return `${what}: ${numbers[0]} ${relation} ${numbers[1]} ${condition.unit}`;
};

/** Older data says its age, ms. */
const OLD_MS = 3000;

/**
 * How old a connected state is, in words; empty where it is fresh. One that runs comes again and again; of another one the
 * service says nothing new, but that it is there.
 */
export const ageOf = (machine, store) => {
  if (!isAvailable(machine) || machine.arrivedAt === undefined) return "";
  const runs = stateOf(machine) === "running";
  const ageMs = performance.now() - (runs ? machine.arrivedAt : Math.max(machine.arrivedAt, store.heardAt));
  const old = runs ? OLD_MS : store.heartbeatMs + OLD_MS;
  return ageMs > old ? t("age", { age: duration(ageMs / 1000) }) : "";
};

/** Why a decision was made: the numbers where it has them, otherwise words. */
const decisionReason = (outcome, reading) => {
  const reason = short(outcome.reason, "DECISION_REASON_");
  if (reading?.value === undefined) return reason === "DATA" ? code(short(outcome.holdReason, "HOLD_REASON_")) : code(reason);
  const above = reason === "FEED_ABOVE_LIMIT";
  const numbers = [reading.value, above ? reading.upper : reading.lower].map((value) => measured(value, reading.unit));
  return `${propertyOf(reading)} ${numbers[0]} ${above ? ">" : "<"} ${numbers[1]} ${reading.unit}`;
};

/** Why the feed is as it is, in words; empty where it is as programmed. */
export const feedReason = (run) => {
  // A hold is stronger than what was decided.
  if (run.held) return t("heldByOperator");
  if (run.feedHeld) return code("FEED_HELD");
  // One that keeps the feed does not say why it is as it is: the one that changed it does.
  const keeps = short(run.lastDecision?.outcome?.reason, "DECISION_REASON_") === "WITHIN_LIMITS" && run.overrides?.feed !== 1;
  const decision = keeps ? run.feedDecision : run.lastDecision;
  const outcome = decision?.outcome;
  if (!outcome) return "";
  const why = decisionReason(outcome, decision.reading);
  // Later decisions have kept it: when it was made is not when the last one was.
  return keeps && decision.time ? `${why} (${t("sinceTime", { time: clock(decision.time) })})` : why;
};

/** How long ago the last decision was made, in words; empty where there is none. */
export const decidedAgo = (run) =>
  run.lastDecision?.time ? t("decidedAgo", { age: duration(oldMs(run.lastDecision.time) / 1000) }) : "";

/** A bar of a value between its limits: the band from the lower to the upper limit is the middle half. */
export const limitBar = () => {
  const bar = element("div", { class: "bar", role: "img" }, element("span", { class: "band" }), element("span", { class: "mark" }));
  return bar;
};

export const paintBar = (bar, process) => {
  const span = process.upper - process.lower;
  const at = span > 0 ? 0.25 + (0.5 * (process.value - process.lower)) / span : 0.5;
  const mark = bar.lastChild;
  mark.style.insetInlineStart = `${Math.min(0.98, Math.max(0.01, at)) * 100}%`;
  setAttribute(bar, "data-out", process.value > process.upper ? "high" : process.value < process.lower ? "low" : null);
  const limits = t("limits", {
    lower: measured(process.lower, process.unit), upper: measured(process.upper, process.unit), unit: process.unit,
  });
  setAttribute(bar, "aria-label", `${propertyOf(process)} ${measured(process.value, process.unit)} ${process.unit}; ${limits}`);
};

/** Sets a value with its unit. */
export const setValue = (node, value, unit) => {
  setText(node.firstChild, value);
  setText(node.lastChild, unit ? ` ${unit}` : "");
};

export const valueNode = (name) =>
  element("span", { class: `value ${name}` }, element("span", { class: "figure" }), element("span", { class: "unit" }));


