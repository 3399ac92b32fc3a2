// A program: its source with the findings under their lines, and how each is cured. However long it is, only what is seen is
// drawn.

import { chips } from "./chip.js";
import { drawing } from "./drawing.js";
import { element, inEnglish, setAttribute, setLines, setText } from "./dom.js";
import { call } from "./grpc.js";
import { Path } from "./path.js";
import { read, readBytes, reasonOf } from "./api.js";
import { isLathe, readMachines } from "./resources.js";
import { findingsText, jobState } from "./jobs.js";
import { bytes, clock, duration, findingName, number, short, t } from "./text.js";

const LINE_PX = 22;
/** Rows of a finding and what is around them; a row has so many letters for each pixel of width, and no more rows are laid out. */
const ROW_PX = 24;
const AROUND_PX = 14;
const LETTER_PX = 8.6;
const MARGIN_PX = 150;
const MOST_ROWS = 12;
/** Beyond that a browser cannot lay an element out: the scroll bar is then coarser than the text. */
const MOST_PX = 12_000_000;
const PIECE_BYTES = 4 << 20;
const MOST_BYTES = 256 << 20;
const EXTRA_LINES = 20;

/** Starts of the lines of a program. */
const startsOf = (data) => {
  let count = 1;
  for (let at = data.indexOf(10); at >= 0; at = data.indexOf(10, at + 1)) count += 1;
  const starts = new Float64Array(count);
  let line = 1;
  for (let at = data.indexOf(10); at >= 0; at = data.indexOf(10, at + 1)) {
    starts[line] = at + 1;
    line += 1;
  }
  return starts;
};

export const program = (place, store, name) => {
  let job = null;
  let report = null;
  let failure = null;
  let data = new Uint8Array(0);
  let starts = new Float64Array(1);
  let size = 0;
  let current = -1;
  const stop = new AbortController();
  const decoder = new TextDecoder("utf-8");

  const title = element("h1", { class: "title" });
  const subtitle = element("p", { class: "subtitle" });
  const notice = element("p", { class: "notice" });
  const previous = element("button", { type: "button", onclick: () => step(-1) });
  const next = element("button", { type: "button", onclick: () => step(1) });
  const count = element("span", { class: "count", "aria-live": "polite" });
  const keys = element("p", { class: "keys" });
  const spacer = element("div", { class: "source-spacer" });
  const lines = element("div", { class: "source-lines" });
  const scroller = element("div", { class: "source", tabindex: "0", role: "region" }, spacer, lines);
  const edit = element("a", { class: "view", href: `/check?job=${name}` });
  const tools = element("div", { class: "tools" }, previous, next, count, edit);
  const chipPictures = chips();
  const picture = drawing({
    onPoint: (line) => point(line),
    onChoose: (line) => {
      scroller.scrollTop = Math.max(0, top(line) - scroller.clientHeight / 3) / scale();
      point(line);
      picture.mark(line);
    },
  });
  let pointed = 0;
  /** What is said of the drawing, in the language of the page. */
  let drawingState = () => "";
  let ownRuns = [];
  const point = (line) => {
    if (line === pointed) return;
    pointed = line;
    drawSource();
  };
  const runs = element("p", { class: "subtitle", hidden: true });
  const shown = element("div", { class: "side-by-side" }, element("div", {}, tools, scroller, keys), picture.root);
  place.append(title, subtitle, runs, notice, shown, chipPictures.root);
  // What is under the pointer, or under the focus of the keyboard, is marked in both.
  const lineUnder = (node) => Number(node.closest?.(".source-line")?.dataset.line ?? 0);
  lines.addEventListener("pointerover", (event) => picture.mark(lineUnder(event.target)));
  lines.addEventListener("pointerleave", () => picture.mark(0));

  /** Findings that have a place in the program itself, by line. */
  let findings = [];

  /** Findings before a line. */
  const before = (line) => {
    let [low, high] = [0, findings.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (findings[middle].line < line) low = middle + 1;
      else high = middle;
    }
    return low;
  };
  /** Heights of the findings before each, px; behind the last one that of all. */
  let heights = [0];
  const rowsOf = (finding) => {
    const letters = Math.max(20, ((scroller.clientWidth || 800) - MARGIN_PX) / LETTER_PX);
    const rows = (text) => Math.max(1, Math.ceil(text.length / letters));
    const cures = (finding.suggestions ?? []).map((cure) => rows(`${t("cure")}:   ${cure.message} ${cure.replacement ?? ""}`));
    return Math.min(MOST_ROWS, [rows(`${findingName(finding)} ${finding.message}`), ...cures].reduce((sum, count) => sum + count, 0));
  };
  const layOut = () => {
    heights = [0];
    for (const finding of findings) heights.push(heights.at(-1) + rowsOf(finding) * ROW_PX + AROUND_PX);
  };
  const top = (line) => (line - 1) * LINE_PX + heights[before(line)];
  const total = () => starts.length * LINE_PX + heights.at(-1);
  const lineAt = (px) => {
    let [low, high] = [1, starts.length];
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (top(middle) <= px) low = middle;
      else high = middle - 1;
    }
    return low;
  };
  const scale = () => {
    const [all, view] = [total(), scroller.clientHeight];
    const laid = Math.min(all, MOST_PX);
    return laid > view ? (all - view) / (laid - view) : 1;
  };
  const lineText = (line) => {
    const from = starts[line - 1];
    const to = line < starts.length ? starts[line] - 1 : data.length;
    return decoder.decode(data.subarray(from, Math.min(to, from + 4096))).replace(/\r$/, "");
  };

  const findingNode = (finding, index) => {
    const severity = short(finding.severity, "SEVERITY_").toLowerCase();
    const cures = (finding.suggestions ?? []).map((cure) =>
      element("li", {}, inEnglish(cure.message), cure.replacement === undefined ? null : element("code", {}, cure.replacement)));
    const often = Number(finding.occurrences) > 1 ? ` · ${t("occurrences", { count: number(finding.occurrences) })}` : "";
    // One that has more rows than are laid out scrolls by itself.
    const scrolls = rowsOf(finding) === MOST_ROWS;
    const node = element(
      "div", { class: "finding", tabindex: scrolls ? "0" : null, "data-severity": severity, "data-current": index === current },
      element("p", { class: "finding-head" }, element("strong", {}, findingName(finding)), inEnglish(finding.message), often),
      cures.length > 0 ? element("div", { class: "cures" }, element("span", {}, `${t("cure")}: `), element("ul", {}, cures)) : null,
    );
    node.style.blockSize = `${heights[index + 1] - heights[index]}px`;
    return node;
  };
  const lineNode = (line) => {
    const marks = findings.slice(before(line), before(line + 1));
    const text = lineText(line);
    const code = element("code");
    const mark = marks.find((finding) => finding.length > 0);
    if (mark) {
      // Columns count bytes.
      const raw = new TextEncoder().encode(text);
      const [from, to] = [mark.column - 1, mark.column - 1 + mark.length];
      const part = (a, b) => decoder.decode(raw.subarray(a, b));
      code.append(part(0, from), element("mark", {}, part(from, to)), part(to));
    } else {
      code.append(text);
    }
    return element("div", { class: "source-line", "data-line": line, "data-pointed": line === pointed }, element("span", { class: "source-number" }, String(line)), code);
  };

  const drawSource = () => {
    const view = scroller.clientHeight || 600;
    spacer.style.blockSize = `${Math.min(total(), MOST_PX)}px`;
    const at = scroller.scrollTop * scale();
    const first = Math.max(1, lineAt(at) - EXTRA_LINES);
    const last = Math.min(starts.length, lineAt(at + view) + EXTRA_LINES);
    const nodes = [];
    for (let line = first; line <= last; line += 1) {
      nodes.push(lineNode(line));
      for (let index = before(line); index < before(line + 1); index += 1) nodes.push(findingNode(findings[index], index));
    }
    lines.style.transform = `translateY(${scroller.scrollTop + top(first) - at}px)`;
    lines.replaceChildren(...nodes);
  };

  const step = (by) => {
    if (findings.length === 0) return;
    current = current < 0 ? (by > 0 ? 0 : findings.length - 1) : (current + by + findings.length) % findings.length;
    const target = top(findings[current].line) - scroller.clientHeight / 3;
    scroller.scrollTop = Math.max(0, target) / scale();
    picture.mark(findings[current].line);
    draw();
  };
  const onKey = (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || ["INPUT", "TEXTAREA"].includes(event.target.tagName)) return;
    if (event.key === "n") step(1);
    if (event.key === "p") step(-1);
  };
  document.addEventListener("keydown", onKey);
  scroller.addEventListener("scroll", () => requestAnimationFrame(drawSource), { passive: true });
  const resized = new ResizeObserver(() => {
    layOut();
    drawSource();
  });
  resized.observe(scroller);

  const draw = () => {
    setText(title, job ? job.displayName || job.name : name);
    const summary = job?.summary;
    const sizeText = job ? bytes(Number(job.programBytes)) : "";
    const parts = job
      ? [job.machine.replace("machines/", ""), jobState(job), sizeText, summary && Number(summary.errors) === 0 ? `${t("duration")} ${duration(summary.durationS)}` : "", `${t("findings")}: ${findingsText(summary)}`]
      : [];
    setText(subtitle, parts.filter(Boolean).join(" · "));
    const elsewhere = (report?.findings ?? []).filter((finding) => finding.file || !finding.line);
    const said = failure
      ? [t("failed", { reason: "" }), reasonOf(failure)]
      : !job ? [t("loading")] : size > data.length ? [t("tooLong", { size: bytes(data.length) })] : job.stateMessage ? [inEnglish(job.stateMessage)] : [];
    const others = elsewhere.map((finding) => [`${findingName(finding)}${finding.file ? ` ${t("inFile", { file: finding.file })}` : ""}: `, inEnglish(finding.message)]);
    setLines(notice, [said, ...others].filter((line) => line.length > 0));
    setAttribute(notice, "hidden", notice.textContent === "");
    // Of a job that is not there is nothing to see.
    setAttribute(shown, "hidden", !job && failure !== null);
    setText(previous, t("previous"));
    setText(next, t("next"));
    for (const button of [previous, next]) setAttribute(button, "disabled", findings.length === 0);
    setText(count, !report ? t("noReport") : findings.length === 0 ? t("noFindings") : `${current < 0 ? "–" : current + 1} / ${number(findings.length)}`);
    setText(keys, t("keyboard"));
    setAttribute(scroller, "aria-label", t("source"));
    layOut();
    setText(edit, t("edit"));
    setAttribute(edit, "hidden", !job || Number(job.programBytes) > store.limits().inlineProgramBytes);
    setAttribute(runs, "hidden", ownRuns.length === 0);
    runs.replaceChildren(`${t("runs")}: `, ...ownRuns.flatMap((one, index) => [index > 0 ? " · " : "", element("a", { href: `/${one.name}` }, clock(one.createTime))]));
    drawSource();
    picture.draw(drawingState());
    chipPictures.draw(report);
  };

  const readReport = async () => {
    try {
      job = await read(`/v1/${name}`, stop.signal);
      report = await read(`/v1/${name}/report`, stop.signal).catch((error) => {
        // Until validation has ended there is none.
        if (error.status === 400) return null;
        throw error;
      });
      ownRuns = (await read(`/v1/runs?${new URLSearchParams({ job: name, pageSize: "5" })}`, stop.signal)).runs;
      const own = (report?.findings ?? []).filter((finding) => finding.line && !finding.file);
      findings = own.sort((a, b) => a.line - b.line || a.column - b.column);
      failure = null;
    } catch (error) {
      if (stop.signal.aborted) return;
      failure = error;
    }
    draw();
  };
  const readSource = async () => {
    try {
      size = Number(job.programBytes);
      const wanted = Math.min(size, MOST_BYTES);
      const whole = new Uint8Array(wanted);
      for (let offset = 0; offset < wanted;) {
        const piece = await readBytes(`/v1/${job.program}?offset=${offset}&length=${Math.min(PIECE_BYTES, wanted - offset)}`, stop.signal);
        if (piece.length === 0) break;
        whole.set(piece, offset);
        offset += piece.length;
        if (offset === piece.length || offset >= wanted) {
          data = whole.subarray(0, offset);
          starts = startsOf(data);
          drawSource();
        }
      }
    } catch (error) {
      if (stop.signal.aborted) return;
      failure = error;
    }
    draw();
  };
  /** Has the program carried out, and draws what it does: up to its first error, or as much as there is room for. */
  const readPath = async () => {
    const path = new Path();
    const enough = new AbortController();
    stop.signal.addEventListener("abort", () => enough.abort());
    drawingState = () => t("loading");
    picture.draw(drawingState());
    let ofLathe = false;
    try {
      const machines = await readMachines(stop.signal);
      ofLathe = isLathe(machines.find((machine) => machine.name === job.machine));
      await call("Programs/Interpret", { job: name }, {
        signal: enough.signal,
        onMessage: (message) => {
          if (!message.actions.every((action) => path.add(action))) enough.abort();
        },
      });
      drawingState = () => (job.state === "JOB_STATE_REJECTED" ? t("drawnToError") : "");
    } catch (error) {
      if (stop.signal.aborted) return;
      drawingState = () => "";
      if (!path.isCut) failure = error;
      draw();
    }
    picture.show(path, ofLathe, drawingState());
  };
  const begin = async () => {
    await readReport();
    if (job) await Promise.all([readSource(), readPath()]);
    const asked = Number(new URLSearchParams(location.search).get("line"));
    if (asked > 0) scroller.scrollTop = top(Math.min(asked, starts.length)) / scale();
  };
  const subscriptions = [
    store.onJob((event) => {
      if (event.job === name) readReport();
    }),
    store.onReset(readReport),
  ];
  draw();
  begin();
  return {
    draw,
    end: () => {
      stop.abort();
      picture.end();
      resized.disconnect();
      document.removeEventListener("keydown", onKey);
      subscriptions.forEach((unsubscribe) => unsubscribe());
    },
  };
};
