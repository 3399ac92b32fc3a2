// The board: a card for each machine, in an order that stays.

import { element, keep, setAttribute, setText } from "./dom.js";
import { duration, measured, percent, t } from "./text.js";
import {
  ageOf, conditionText, decidedAgo, feedReason, isAvailable, isUnacknowledged, levelOf, limitBar, nameOf, otherRuns, paintBar, paintIcon,
  propertyOf, setValue, stateIcon, stateOf, valueNode,
} from "./state.js";

/** How long a page of the wall stays, ms. */
const TURN_MS = 12000;
const PER_PAGE = 12;
/** Cards of a wall that fill it; the next larger grid is taken. */
const GRIDS = [1, 2, 4, 6, 9, PER_PAGE];

const FILTERS = ["all", "attention", "running", "held", "stopped"];

const shown = (machine, filter) => {
  if (filter === "all") return true;
  if (filter === "attention") return levelOf(machine) !== "normal";
  return stateOf(machine) === filter;
};

/** The pages of a wall: machines in their order, pages with faults first. */
const pagesOf = (machines) => {
  const count = Math.max(1, Math.ceil(machines.length / PER_PAGE));
  const pages = Array.from({ length: count }, (_, index) => machines.slice(index * PER_PAGE, (index + 1) * PER_PAGE));
  const hasFault = (page) => page.some((machine) => levelOf(machine) === "fault");
  return [...pages.filter(hasFault), ...pages.filter((page) => !hasFault(page))];
};

const makeCard = () => {
  const icon = stateIcon();
  return element(
    "a", { class: "card" },
    element("span", { class: "card-head" }, element("span", { class: "name" }), icon, element("span", { class: "state" })),
    element("span", { class: "job" }),
    element("span", { class: "figures" }, valueNode("override"), valueNode("left")),
    element("span", { class: "reason" }),
    element("span", { class: "progress", "aria-hidden": "true" }, element("span", { class: "progress-done" })),
    element("span", { class: "process" }, element("span", { class: "process-text" }), limitBar()),
    element("span", { class: "alarm" }),
    element("span", { class: "age" }),
  );
};

const jobText = (run) => {
  const name = run.jobDisplayName || run.job.replace("jobs/", "").slice(0, 8);
  const parts = [name];
  if (run.tool) parts.push(t("tool", { tool: run.tool }));
  if (run.commanded?.line) parts.push(t("line", { line: run.commanded.line }));
  return parts.join(" · ");
};

const updateCard = (store, isWall) => (card, machine) => {
  const find = (name) => card.querySelector(`.${name}`);
  const run = machine.run;
  const state = stateOf(machine);
  const available = isAvailable(machine);
  setAttribute(card, "href", run ? `/${run.run}` : null);
  setAttribute(card, "data-level", levelOf(machine));
  setAttribute(card, "data-blinks", isUnacknowledged(machine));
  setText(find("name"), nameOf(machine));
  paintIcon(card.querySelector(".icon"), state);
  setText(find("state"), t(state));
  setText(find("job"), run ? jobText(run) : t("noData"));
  const overrides = available ? run?.overrides : undefined;
  setValue(find("override"), overrides ? percent(overrides.feed) : "–", t("feed"));
  const left = available ? run?.progress?.remainingS : undefined;
  setValue(find("left"), left === undefined ? "–" : `≈ ${duration(left)}`, t("left"));
  const ratio = run?.progress?.ratio ?? 0;
  card.querySelector(".progress-done").style.inlineSize = `${(available || state === "done" ? ratio : 0) * 100}%`;
  const process = available ? run?.process : undefined;
  setAttribute(find("process"), "hidden", process?.value === undefined);
  if (process?.value !== undefined) {
    setText(find("process-text"), `${propertyOf(process)} ${measured(process.value, process.unit)} ${process.unit}`);
    paintBar(card.querySelector(".bar"), process);
  }
  const conditions = (machine.conditions ?? []).filter((one) => available || one.needsAcknowledgement || one.severity === "CONDITION_SEVERITY_FAULT");
  const further = conditions.length > 1 ? ` · ${t("further", { count: conditions.length - 1 })}` : "";
  // What an alarm says need not be said twice.
  const reason = overrides && (overrides.feed !== 1 || run.held) ? feedReason(run) : "";
  const decided = overrides ? decidedAgo(run) : "";
  setText(find("reason"), conditions.length === 0 ? [reason, decided].filter(Boolean).join(" · ") : "");
  const [first] = conditions;
  // The run that the card shows is another one.
  const whose = first?.run && run && first.run !== run.run ? `${t("ofOtherRun")}: ` : "";
  setText(find("alarm"), first ? whose + conditionText(first) + further : "");
  // On a wall there is no room for it beside an alarm.
  setText(find("age"), [otherRuns(machine), conditions.length > 0 && !isWall ? decided : "", ageOf(machine, store)].filter(Boolean).join(" · "));
};

/** Shows the board in a place; what is returned ends it. */
export const board = (place, store, parameters) => {
  const isWall = parameters.get("view") === "wall";
  let filter = FILTERS.includes(parameters.get("show")) ? parameters.get("show") : "all";
  let page = 0;
  const cards = element("div", { class: isWall ? "cards wall" : "cards" });
  const nothing = element("p", { class: "notice", hidden: true });
  const turning = element("p", { class: "turning", hidden: true });
  const filters = element("div", { class: "filters", role: "group" });
  const title = element("h1", { class: "unseen" });
  const tools = element("div", { class: "tools" }, filters, element("a", { class: "view" }));
  place.append(title, tools, nothing, cards, turning);

  const draw = () => {
    document.body.classList.toggle("is-wall", isWall);
    setText(title, t("board"));
    setAttribute(filters, "aria-label", t("filter"));
    keep(
      filters, FILTERS, (name) => name,
      (name) => element("button", { type: "button", onclick: () => choose(name) }),
      (button, name) => {
        setText(button, t(name));
        setAttribute(button, "aria-pressed", name === filter ? "true" : "false");
      },
    );
    const view = tools.querySelector(".view");
    setText(view, t(isWall ? "dense" : "wall"));
    setAttribute(view, "href", isWall ? "/" : "/?view=wall");
    const machines = [...store.machines.values()].sort((a, b) => (a.machine < b.machine ? -1 : 1));
    const wanted = machines.filter((machine) => shown(machine, filter));
    const turned = pagesOf(wanted);
    const pages = isWall ? turned.length : 1;
    page %= pages;
    const visible = isWall ? turned[page] : wanted;
    setAttribute(cards, "data-grid", isWall ? GRIDS.find((count) => count >= (pages > 1 ? PER_PAGE : visible.length)) : null);
    keep(cards, visible, (machine) => machine.machine, makeCard, updateCard(store, isWall));
    setAttribute(nothing, "hidden", wanted.length > 0);
    setText(nothing, !store.isRead ? t("loading") : t(machines.length === 0 ? "noMachines" : "noneMatches"));
    setAttribute(turning, "hidden", pages === 1);
    setText(turning, t("page", { page: page + 1, pages }));
  };
  const choose = (name) => {
    filter = name;
    draw();
  };
  const turn = setInterval(() => {
    page += 1;
    draw();
  }, TURN_MS);
  const tick = setInterval(draw, 1000);
  const unsubscribe = store.onChange(draw);
  draw();
  return {
    draw,
    end: () => {
      clearInterval(turn);
      clearInterval(tick);
      unsubscribe();
      document.body.classList.remove("is-wall");
    },
  };
};
