// Jobs: the queue, how far validation is, what it found.

import { element, keep, setAttribute, setLines, setText } from "./dom.js";
import { read, reasonOf } from "./api.js";
import { nameOf } from "./state.js";
import { dropZone } from "./upload.js";
import { bytes, clock, currentLanguage, duration, number, percent, short, t } from "./text.js";

const COLUMNS = ["job", "machine", "state", "progress", "findings", "created"];
const STATES = {
  PENDING: "pending", VALIDATING: "validating", READY: "jobReady", REJECTED: "rejected", CANCELLED: "cancelled", FAILED: "jobFailed",
};
const ALARMING = new Set(["REJECTED", "FAILED"]);
/** Events that come together are one reason to read the list. */
const GATHER_MS = 300;
const PROGRESS_MS = 2000;

export const jobState = (job) => t(STATES[short(job.state, "JOB_STATE_")] ?? "unknown");

/** Counts of findings in words. */
export const findingsText = (summary) => {
  if (!summary) return "–";
  const counts = [["errors", summary.errors], ["warnings", summary.warnings], ["notes", summary.infos]];
  const found = counts.filter(([, count]) => Number(count) > 0);
  return found.length === 0 ? t("none") : found.map(([name, count]) => t(name, { count: number(count) })).join(", ");
};

const progressText = (job) => {
  if (!job.validation) return job.summary && Number(job.summary.errors) === 0 ? `${t("duration")} ${duration(job.summary.durationS)}` : "–";
  const place = Number(job.validation.queuePlace);
  if (place > 0) return t("queued", { place: number(place) });
  const size = Number(job.programBytes);
  return t("validated", { percent: percent(size > 0 ? Number(job.validation.readBytes) / size : 0) });
};

export const jobs = (place, store) => {
  let list = [];
  let token = "";
  let failure = null;
  let isRead = false;
  let gathering = null;
  let drawnMachines = new Map();
  const stop = new AbortController();
  const title = element("h1", { class: "title" });
  const notice = element("p", { class: "notice" });
  const head = element("tr", {}, ...COLUMNS.map((name) => element("th", { scope: "col", "data-name": name })));
  const rows = element("tbody");
  const table = element("table", { class: "jobs" }, element("thead", {}, head), rows);
  const more = element("button", { type: "button", onclick: () => readPage(token) });
  const zone = dropZone(store);
  place.append(title, zone.root, notice, element("div", { class: "scrolls" }, table), more);

  const machineOf = (job) => {
    const machine = store.machines.get(job.machine);
    return machine ? nameOf(machine) : job.machine.replace("machines/", "");
  };

  const draw = () => {
    drawnMachines = new Map(list.map((job) => [job.machine, machineOf(job)]));
    setText(title, t("jobs"));
    zone.draw();
    for (const cell of head.children) setText(cell, t(cell.dataset.name));
    setAttribute(notice, "hidden", isRead && !failure && list.length > 0);
    setLines(notice, [failure ? [t("failed", { reason: "" }), reasonOf(failure)] : [isRead ? t("none") : t("loading")]]);
    setAttribute(table, "hidden", list.length === 0);
    keep(
      rows, list, (job) => job.name,
      (job) => element("tr", {}, element("th", { scope: "row" }, element("a", { href: `/${job.name}` })), ...COLUMNS.slice(1).map(() => element("td", {}, element("span")))),
      (row, job) => {
        const state = short(job.state, "JOB_STATE_");
        const [name, machine, word, progress, findings, created] = row.children;
        // On a narrow screen, where a row is a block, each cell says what it is.
        COLUMNS.forEach((column, at) => setAttribute(row.children[at], "data-label", t(column)));
        setText(name.firstChild, job.displayName || job.name.replace("jobs/", ""));
        setText(machine.firstChild, machineOf(job));
        setText(word.firstChild, jobState(job));
        setAttribute(word, "data-alarm", ALARMING.has(state));
        // The reason is in English, the word above it is not.
        setAttribute(word, "title", job.stateMessage);
        setAttribute(word, "lang", job.stateMessage ? "en" : null);
        setAttribute(word.firstChild, "lang", job.stateMessage ? currentLanguage() : null);
        setText(progress.firstChild, progressText(job));
        setText(findings.firstChild, findingsText(job.summary));
        setAttribute(findings, "data-level", Number(job.summary?.errors) > 0 ? "fault" : Number(job.summary?.warnings) > 0 ? "warning" : null);
        setText(created.firstChild, `${clock(job.createTime)} · ${bytes(Number(job.programBytes))}`);
      },
    );
    setText(more, t("more"));
    setAttribute(more, "hidden", token === "");
  };

  const readPage = async (from) => {
    try {
      const query = new URLSearchParams({ pageSize: "100", ...(from ? { pageToken: from } : {}) });
      const page = await read(`/v1/jobs?${query}`, stop.signal);
      const names = new Set(page.jobs.map((job) => job.name));
      // The first page again: what is further down stays.
      list = from ? [...list.filter((job) => !names.has(job.name)), ...page.jobs] : [...page.jobs, ...list.filter((job) => !names.has(job.name) && list.indexOf(job) >= page.jobs.length)];
      if (from || !isRead) token = page.nextPageToken;
      isRead = true;
      failure = null;
    } catch (error) {
      if (stop.signal.aborted) return;
      failure = error;
    }
    draw();
  };
  const again = () => {
    gathering ??= setTimeout(() => {
      gathering = null;
      readPage("");
    }, GATHER_MS);
  };
  const progress = setInterval(() => {
    if (list.some((job) => job.validation)) again();
  }, PROGRESS_MS);
  // Names of machines come with their states, which may be later than the list.
  const named = (machine) => {
    const drawn = machine && drawnMachines.get(machine.machine);
    if (drawn !== undefined && drawn !== nameOf(machine)) draw();
  };
  const subscriptions = [store.onJob(again), store.onReset(again), store.onChange(named)];
  draw();
  readPage("");
  return {
    draw,
    get drop() {
      return store.mayPlan() ? zone.add : undefined;
    },
    end: () => {
      stop.abort();
      zone.end();
      clearInterval(progress);
      clearTimeout(gathering);
      subscriptions.forEach((unsubscribe) => unsubscribe());
    },
  };
};
