// A text with findings in place: each marked and named in its line, the one at the cursor under it with its cures.

import { element, inEnglish, setAttribute, setText } from "./dom.js";
import { findingName, short, t } from "./text.js";

export const LINE_PX = 22;
const EXTRA_LINES = 10;
const PAD_PX = 4;
const ORDER = { SEVERITY_ERROR: 0, SEVERITY_WARNING: 1, SEVERITY_INFO: 2 };

const toUtf8 = new TextEncoder();

/** Where a byte column of a line is in its text, from 0. */
const place = (text, column) => {
  let bytes = 0;
  let at = 0;
  for (const sign of text) {
    if (bytes >= column - 1) break;
    bytes += toUtf8.encode(sign).length;
    at += sign.length;
  }
  return at;
};

/** Starts of the lines of a text, and one behind its end. */
const startsOf = (text) => {
  const starts = [0];
  for (let at = text.indexOf("\n"); at >= 0; at = text.indexOf("\n", at + 1)) starts.push(at + 1);
  return [...starts, text.length + 1];
};

const severityOf = (finding) => short(finding.severity, "SEVERITY_").toLowerCase();

/**
 * An editor. `onEdit` is called with each change of the text, `onLine` with the line of the cursor. Findings are of the text
 * that they were made for: an edit moves those around it, and takes away what it touches.
 */
export const editor = ({ onEdit, onLine }) => {
  let text = "";
  let starts = startsOf(text);
  let findings = [];
  let isCurrent = true;
  let current = -1;
  let pointed = 0;

  const gutter = element("div", { class: "editor-gutter", "aria-hidden": "true" });
  const marks = element("div", { class: "editor-marks", "aria-hidden": "true" });
  const area = element("textarea", { class: "editor-text", spellcheck: "false", autocapitalize: "off", autocomplete: "off", wrap: "off" });
  const shown = element("div", { class: "finding editor-finding", hidden: true });
  const root = element("div", { class: "editor" }, gutter, element("div", { class: "editor-pane" }, marks, area, shown));

  const lineText = (line) => text.slice(starts[line - 1], starts[line] - 1);
  const lineOf = (at) => {
    let [low, high] = [1, starts.length - 1];
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (starts[middle - 1] <= at) low = middle;
      else high = middle - 1;
    }
    return low;
  };
  const ofLine = (line) => findings.filter((finding) => finding.line === line);

  const markedLine = (line) => {
    const own = ofLine(line);
    const content = lineText(line);
    const code = element("code");
    // Marks must not overlap: the worst ones first.
    const spans = [];
    for (const finding of [...own].sort((a, b) => ORDER[a.severity] - ORDER[b.severity])) {
      const from = place(content, finding.column);
      const to = Math.max(from + 1, place(content, finding.column + finding.length));
      if (!spans.some((span) => from < span.to && span.from < to)) spans.push({ from, to, severity: severityOf(finding) });
    }
    let at = 0;
    for (const span of spans.sort((a, b) => a.from - b.from)) {
      code.append(content.slice(at, span.from), element("mark", { "data-severity": span.severity }, content.slice(span.from, span.to) || " "));
      at = span.to;
    }
    code.append(content.slice(at));
    const worst = [...own].sort((a, b) => ORDER[a.severity] - ORDER[b.severity])[0];
    const more = own.length > 1 ? ` (+${own.length - 1})` : "";
    const note = worst ? element("span", { class: "editor-note", "data-severity": severityOf(worst) }, `${findingName(worst)}${more}: `, inEnglish(worst.message)) : null;
    return element("div", { class: "editor-line", "data-pointed": line === pointed, "data-line": line }, code, note);
  };

  const drawLines = () => {
    const view = area.clientHeight || 600;
    const first = Math.max(1, Math.floor(area.scrollTop / LINE_PX) - EXTRA_LINES);
    const last = Math.min(starts.length - 1, Math.ceil((area.scrollTop + view) / LINE_PX) + EXTRA_LINES);
    const offset = PAD_PX + (first - 1) * LINE_PX - area.scrollTop;
    const numbers = [];
    const lines = [];
    for (let line = first; line <= last; line += 1) {
      const worst = ofLine(line).map(severityOf)[0];
      numbers.push(element("div", { "data-severity": worst }, String(line)));
      lines.push(markedLine(line));
    }
    gutter.replaceChildren(element("div", {}, ...numbers));
    gutter.firstChild.style.transform = `translateY(${offset}px)`;
    marks.replaceChildren(element("div", { class: "editor-lines" }, ...lines));
    marks.firstChild.style.transform = `translate(${-area.scrollLeft}px, ${offset}px)`;
    setAttribute(root, "data-old", !isCurrent);
    placeFinding();
  };

  const placeFinding = () => {
    const finding = findings[current];
    if (!finding) return;
    const top = PAD_PX + finding.line * LINE_PX - area.scrollTop;
    shown.style.insetBlockStart = `${top}px`;
    setAttribute(shown, "hidden", top < LINE_PX || top > area.clientHeight);
  };

  const cure = (finding, replacement) => {
    if (!isCurrent) return;
    const content = lineText(finding.line);
    const from = starts[finding.line - 1] + place(content, finding.column);
    const to = starts[finding.line - 1] + place(content, finding.column + finding.length);
    area.focus();
    area.setSelectionRange(from, to);
    // So that it can be undone as what is typed can.
    const done = document.execCommand(replacement === "" ? "delete" : "insertText", false, replacement);
    if (!done) {
      area.setRangeText(replacement, from, to, "end");
      edited();
    }
  };

  const drawFinding = () => {
    const finding = findings[current];
    setAttribute(shown, "hidden", !finding);
    if (!finding) {
      shown.replaceChildren();
      return;
    }
    setAttribute(shown, "data-severity", severityOf(finding));
    const place = `${current + 1} / ${findings.length}`;
    const often = Number(finding.occurrences) > 1 ? ` · ${t("occurrences", { count: finding.occurrences })}` : "";
    const cures = (finding.suggestions ?? []).map((one) => element(
      "li", {}, inEnglish(one.message),
      one.replacement === undefined ? null : element(
        "button", { type: "button", class: "cure", disabled: !isCurrent, onclick: () => cure(finding, one.replacement) },
        one.replacement === "" ? t("curesBy") : `${t("cureWith")} `, one.replacement === "" ? null : element("code", {}, one.replacement),
      ),
    ));
    const related = (finding.related ?? []).map((one) => element(
      "li", {}, one.file || !one.line ? inEnglish(one.message) : element("button", { type: "button", class: "link", onclick: () => go(one.line) }, `${t("line", { line: one.line })}: `, inEnglish(one.message))));
    shown.replaceChildren(
      element("p", { class: "finding-head" }, element("strong", {}, findingName(finding)), inEnglish(finding.message), often, element("span", { class: "finding-place" }, place)),
      ...(cures.length + related.length > 0 ? [element("ul", { class: "finding-cures" }, ...cures, ...related)] : []),
    );
    placeFinding();
  };

  /** Lets what is at the cursor be shown under its line. */
  const followCursor = () => {
    const line = lineOf(area.selectionStart);
    const here = findings[current]?.line === line ? current : findings.findIndex((finding) => finding.line === line);
    if (here !== current) {
      current = here;
      drawFinding();
    }
    onLine(line);
  };

  /** What an edit leaves of the findings: `from` and `to` are the lines of the former text that it touched. */
  const moveFindings = (before, beforeStarts) => {
    let head = 0;
    const least = Math.min(before.length, text.length);
    while (head < least && before[head] === text[head]) head += 1;
    let tail = 0;
    while (tail < least - head && before[before.length - 1 - tail] === text[text.length - 1 - tail]) tail += 1;
    const first = lineOf(Math.min(head, text.length));
    const added = starts.length - beforeStarts.length;
    const end = before.length - tail;
    let last = first;
    while (last < beforeStarts.length - 1 && beforeStarts[last] <= end) last += 1;
    findings = findings
      .filter((finding) => finding.line < first || finding.line > last)
      .map((finding) => (finding.line > last ? { ...finding, line: finding.line + added } : finding));
  };

  /** What comes together, as a browser inserts a text line by line, is one edit. */
  let waiting = 0;
  const noticed = () => {
    isCurrent = false;
    waiting ||= setTimeout(edited);
  };
  const edited = () => {
    clearTimeout(waiting);
    waiting = 0;
    const [before, beforeStarts] = [text, starts];
    text = area.value;
    starts = startsOf(text);
    isCurrent = false;
    current = -1;
    moveFindings(before, beforeStarts);
    followCursor();
    drawFinding();
    drawLines();
    onEdit(text);
  };

  const go = (line, column = 1) => {
    if (waiting) edited();
    const wanted = Math.min(Math.max(1, line), starts.length - 1);
    const at = starts[wanted - 1] + place(lineText(wanted), column);
    area.focus({ preventScroll: true });
    area.setSelectionRange(at, at);
    area.scrollTop = Math.max(0, (wanted - 1) * LINE_PX - area.clientHeight / 3);
    followCursor();
    drawLines();
  };

  const step = (by) => {
    if (waiting) edited();
    if (findings.length === 0) return;
    const line = lineOf(area.selectionStart);
    let next = current + by;
    if (current < 0) {
      const behind = findings.findIndex((finding) => finding.line > line);
      next = by > 0 ? (behind < 0 ? 0 : behind) : (behind < 0 ? findings.length : behind) - 1;
    }
    const target = (next + findings.length) % findings.length;
    const finding = findings[target];
    current = target;
    go(finding.line, finding.column);
    current = target;
    drawFinding();
  };

  area.addEventListener("input", noticed);
  area.addEventListener("scroll", () => requestAnimationFrame(drawLines), { passive: true });
  const moved = () => {
    if (document.activeElement === area && !waiting) followCursor();
  };
  document.addEventListener("selectionchange", moved);
  area.addEventListener("keydown", (event) => {
    if (event.key === "F8") {
      event.preventDefault();
      step(event.shiftKey ? -1 : 1);
    } else if (event.key === "Enter" && event.altKey) {
      event.preventDefault();
      const finding = findings[current];
      const best = finding?.suggestions?.find((one) => one.replacement !== undefined);
      if (best) cure(finding, best.replacement);
    }
  });
  area.addEventListener("pointermove", (event) => {
    const line = Math.floor((event.offsetY - PAD_PX) / LINE_PX) + 1;
    if (line >= 1 && line < starts.length) onLine(line);
  });
  area.addEventListener("pointerleave", () => onLine(lineOf(area.selectionStart)));
  const resized = new ResizeObserver(drawLines);
  resized.observe(area);

  return {
    root,
    go,
    step,
    count: () => findings.length,
    current: () => current,
    /** Another text, which nobody typed. */
    setText: (value) => {
      area.value = value;
      text = area.value;
      starts = startsOf(text);
      findings = [];
      current = -1;
      area.scrollTop = 0;
      area.setSelectionRange(0, 0);
      drawFinding();
      drawLines();
    },
    text: () => text,
    /** What was found in the present text. */
    setFindings: (found) => {
      findings = found;
      isCurrent = true;
      current = -1;
      followCursor();
      drawFinding();
      drawLines();
    },
    /** Marks a line that something else points at; 0: none. */
    point: (line) => {
      if (line === pointed) return;
      pointed = line;
      drawLines();
    },
    /** Words in another language. */
    draw: () => {
      setAttribute(area, "aria-label", t("source"));
      drawFinding();
      drawLines();
    },
    end: () => {
      clearTimeout(waiting);
      resized.disconnect();
      document.removeEventListener("selectionchange", moved);
    },
  };
};
