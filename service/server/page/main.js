// The page: which view is shown, what all views know, the bar at the top.

import { board } from "./board.js";
import { check, takeFile } from "./check.js";
import { element, keep, setAttribute, setText } from "./dom.js";
import { chosenTenant, follow, forget, hasToken, oldMs, read, setTenant, setToken } from "./api.js";
import { jobs } from "./jobs.js";
import { program } from "./program.js";
import { run } from "./run.js";
import { conditionText, levelOf, nameOf, stateOf } from "./state.js";
import { clock, currentLanguage, remember, remembered, switchLanguage, t } from "./text.js";

/** Listeners of one kind. */
const listeners = () => {
  const all = new Set();
  return {
    add: (listener) => {
      all.add(listener);
      return () => all.delete(listener);
    },
    call: (...values) => [...all].forEach((listener) => listener(...values)),
  };
};

const changes = listeners();
const decisions = listeners();
const jobEvents = listeners();
const resets = listeners();

/** What the service says of itself and of who asks; of an older one nothing. */
let service = {};
const DEFAULT_INLINE_BYTES = 1 << 20;
const readService = async () => {
  try {
    service = await read("/v1/state");
  } catch (error) {
    // A tenant that cannot be is none that was chosen here.
    if (error.status === 400 && chosenTenant()) {
      setTenant("");
      location.reload();
    }
  }
  drawHead();
  view?.draw();
};

/** What all views know. */
const store = {
  machines: new Map(),
  isRead: false,
  /** When the service said anything last, and how often it does at least, by the clock of this page, ms. */
  heardAt: performance.now(),
  heartbeatMs: 15000,
  onChange: changes.add,
  onDecision: decisions.add,
  onJob: jobEvents.add,
  onReset: resets.add,
  /** Whether who asks may have programs validated and make jobs of them. */
  mayPlan: () => (service.caller?.roles ?? []).some((role) => role === "planner" || role === "admin"),
  limits: () => ({ inlineProgramBytes: Number(service.inlineProgramBytes ?? DEFAULT_INLINE_BYTES) }),
  /** Goes to another view. */
  go: (path) => go(path),
};

const content = document.getElementById("content");
const connection = document.getElementById("connection");
const summary = document.getElementById("summary");
const alarms = document.getElementById("alarms");
let view = null;
let lostSince = null;

const THEMES = ["auto", "light", "dark"];
const NAMES = { auto: "themeAuto", light: "themeLight", dark: "themeDark" };
let theme = THEMES.includes(remembered("theme")) ? remembered("theme") : "auto";

const paintTheme = () => setAttribute(document.documentElement, "data-theme", theme === "auto" ? null : theme);

const missing = (place) => {
  const notice = element("p", { class: "notice" });
  place.append(notice);
  const draw = () => setText(notice, t("missing"));
  draw();
  return { draw, end: () => {} };
};

const viewOf = (path, parameters) => {
  if (path === "/") return ["board", (place) => board(place, store, parameters)];
  if (path === "/check") return ["check", (place) => check(place, store, parameters)];
  if (path === "/jobs") return ["jobs", (place) => jobs(place, store)];
  const of = path.match(/^\/((runs|jobs)\/[0-9a-f-]{36})$/);
  if (of?.[2] === "runs") return ["run", (place) => run(place, store, of[1])];
  if (of?.[2] === "jobs") return ["program", (place) => program(place, store, of[1])];
  return ["missing", missing];
};

const show = () => {
  const [name, make] = viewOf(location.pathname, new URLSearchParams(location.search));
  view?.end();
  content.replaceChildren();
  document.body.dataset.view = name;
  view = make(content);
  drawHead();
};

const drawHead = () => {
  document.documentElement.lang = currentLanguage();
  for (const node of document.querySelectorAll("[data-text]")) setText(node, t(node.dataset.text));
  for (const link of document.querySelectorAll("[data-view]")) {
    if (link !== document.body) setAttribute(link, "aria-current", link.dataset.view === document.body.dataset.view ? "page" : null);
  }
  setText(document.getElementById("language"), t("other"));
  setAttribute(document.getElementById("language"), "lang", currentLanguage() === "en" ? "de" : "en");
  setText(document.getElementById("theme"), t(NAMES[theme]));
  drawCaller();
  const counts = new Map();
  for (const machine of store.machines.values()) {
    // A fault that waits counts as one, whatever the machine does now.
    const state = levelOf(machine) === "fault" ? "fault" : stateOf(machine);
    counts.set(state, (counts.get(state) ?? 0) + 1);
  }
  const order = ["fault", "stopped", "held", "interrupted", "running", "ready", "done", "idle"];
  const list = order.filter((state) => counts.has(state)).map((state) => [state, counts.get(state)]);
  const level = { fault: "fault", stopped: "hold", held: "hold" };
  keep(
    summary, list, ([state]) => state, () => element("span", { class: "count" }),
    (node, [state, count]) => {
      setText(node, `${count} ${t(state)}`);
      setAttribute(node, "data-level", level[state]);
    },
  );
  document.body.toggleAttribute("data-lost", lostSince !== null);
  setAttribute(connection, "hidden", lostSince === null);
  if (lostSince !== null) setText(connection, t("lost", { time: clock(lostSince) }));
};

const tenantForm = document.getElementById("tenant-form");
const tenant = document.getElementById("tenant");
const leave = document.getElementById("leave");

/** Who asks, and for which tenant; nothing where nobody has to say so. */
const drawCaller = () => {
  const caller = service.caller;
  setAttribute(tenantForm, "hidden", !(caller?.anyTenant && (caller.hasTenants || chosenTenant())));
  if (document.activeElement !== tenant) tenant.value = chosenTenant() || caller?.tenant || "";
  const isNamed = caller && !caller.anyTenant && caller.hasTenants;
  setText(leave, t("leave", { name: caller?.name ?? "" }) + (isNamed && caller.tenant ? ` (${caller.tenant})` : ""));
  setAttribute(leave, "hidden", !hasToken());
};
tenantForm.addEventListener("submit", (event) => {
  event.preventDefault();
  setTenant(tenant.value.trim());
  location.reload();
});
leave.addEventListener("click", () => {
  forget();
  location.reload();
});

/** Says new faults to who cannot see them. */
const said = new Set();
const announce = (machine) => {
  for (const condition of machine.conditions ?? []) {
    const key = `${machine.machine} ${condition.code} ${condition.raiseTime ?? ""}`;
    if (condition.severity !== "CONDITION_SEVERITY_FAULT" || said.has(key)) continue;
    said.add(key);
    if (store.isRead) setText(alarms, `${nameOf(machine)}: ${conditionText(condition)}`);
  }
};

const askForToken = () => {
  view?.end();
  view = null;
  const input = element("input", { type: "password", id: "token", autocomplete: "current-password", required: true });
  const submit = (event) => {
    event.preventDefault();
    setToken(input.value);
    location.reload();
  };
  content.replaceChildren(
    element(
      "form", { class: "token", onsubmit: submit },
      element("p", {}, t("tokenWhy")), element("label", { for: "token" }, t("token")), input,
      element("button", { type: "submit" }, t("tokenGo")),
    ),
  );
  input.focus();
};

follow({
  open: () => {
    lostSince = null;
    readService();
    // The states of all machines come now; those that are not among them are gone.
    store.machines.clear();
    drawHead();
  },
  lost: () => {
    // Nothing was heard since then: that it is lost is noticed later.
    lostSince ??= Date.now() - (performance.now() - store.heardAt);
    drawHead();
  },
  refused: askForToken,
  heard: () => {
    store.heardAt = performance.now();
  },
  heartbeat: (heartbeatMs) => {
    store.heartbeatMs = heartbeatMs;
  },
  state: (machine) => {
    announce(machine);
    // One that runs may have stood still for long when this page comes to see it.
    machine.arrivedAt = performance.now() - oldMs(machine.run?.updateTime);
    store.machines.set(machine.machine, machine);
    store.isRead = true;
    changes.call(machine);
    drawHead();
  },
  gone: ({ machine }) => {
    store.machines.delete(machine);
    changes.call();
    drawHead();
  },
  decision: decisions.call,
  job: jobEvents.call,
  reset: resets.call,
});

document.getElementById("language").addEventListener("click", () => {
  switchLanguage();
  drawHead();
  view?.draw();
});
document.getElementById("theme").addEventListener("click", () => {
  theme = THEMES[(THEMES.indexOf(theme) + 1) % THEMES.length];
  remember("theme", theme);
  paintTheme();
  drawHead();
});
const go = (path) => {
  history.pushState(null, "", path);
  show();
  content.focus({ preventScroll: true });
  scrollTo(0, 0);
};
const hasFiles = (event) => [...(event.dataTransfer?.types ?? [])].includes("Files");
document.addEventListener("dragover", (event) => {
  if (!hasFiles(event)) return;
  event.preventDefault();
  document.body.dataset.dropping = "";
});
document.addEventListener("dragleave", (event) => {
  if (!event.relatedTarget) delete document.body.dataset.dropping;
});
// A program that is dropped anywhere is checked; on the jobs it is to become one.
document.addEventListener("drop", async (event) => {
  delete document.body.dataset.dropping;
  if (!hasFiles(event)) return;
  event.preventDefault();
  const files = [...event.dataTransfer.files];
  if (files.length === 0) return;
  if (view?.drop) view.drop(files);
  else {
    await takeFile(files[0], store.limits());
    go("/check");
  }
});
document.addEventListener("click", (event) => {
  const link = event.target.closest("a[href^='/']");
  if (!link || event.defaultPrevented || event.button !== 0 || event.ctrlKey || event.metaKey || event.shiftKey) return;
  event.preventDefault();
  go(link.getAttribute("href"));
});
addEventListener("popstate", show);
document.querySelector(".skip").addEventListener("click", () => content.focus());

paintTheme();
show();

