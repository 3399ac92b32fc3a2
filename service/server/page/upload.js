// Programs become jobs: dropped or chosen, for one machine, by who may.

import { call } from "./grpc.js";
import { reasonOf } from "./api.js";
import { element, keep, setAttribute, setLines, setText } from "./dom.js";
import { machineName, readMachines } from "./resources.js";
import { bytes, t } from "./text.js";

/** What a browser is asked to hold at once. */
const MOST_BYTES = 256 << 20;
const CHUNK_BYTES = 1 << 20;
const MOST_FILES = 50;
const MOST_NAME = 200;

const hexadecimal = (data) => [...new Uint8Array(data)].map((byte) => byte.toString(16).padStart(2, "0")).join("");

/** Sends a program that is too large for a request; its name. */
const upload = async (file, signal) => {
  // Browsers hash where nobody can change what they are given.
  if (!globalThis.crypto?.subtle) throw new Error(t("uploadInsecure"));
  const data = await file.arrayBuffer();
  const sha256 = hexadecimal(await crypto.subtle.digest("SHA-256", data));
  const header = { sha256, programBytes: data.byteLength, offset: 0, fileName: file.name.slice(0, MOST_NAME) };
  const chunks = Array.from({ length: Math.ceil(data.byteLength / CHUNK_BYTES) }, (_, index) => {
    const offset = index * CHUNK_BYTES;
    return { chunk: { offset, data: new Uint8Array(data, offset, Math.min(CHUNK_BYTES, data.byteLength - offset)) } };
  });
  return (await call("Jobs/UploadProgram", [{ header }, ...chunks], { signal })).program;
};

/** A job from a file; as the service answers it. */
export const createJob = async (file, { machine, tools = [], limits, signal }) => {
  if (file.size > MOST_BYTES) throw new Error(t("uploadTooLarge", { size: bytes(MOST_BYTES) }));
  const source = file.size > limits.inlineProgramBytes
    ? { program: await upload(file, signal) }
    : { inlineProgram: new Uint8Array(await file.arrayBuffer()) };
  const name = file.name.slice(0, MOST_NAME);
  const request = { requestId: hexadecimal(crypto.getRandomValues(new Uint8Array(16)).buffer), machine, tools, displayName: name, fileName: name, ...source };
  return (await call("Jobs/CreateJob", request, { signal })).job;
};

/** Where programs are dropped. */
export const dropZone = (store) => {
  let files = [];
  let machines = [];
  let failure = null;
  const stop = new AbortController();
  const words = element("p", { class: "drop-words" });
  const choose = element("input", { type: "file", multiple: true, id: "programs", class: "unseen" });
  const label = element("label", { class: "view", for: "programs" });
  const list = element("ul", { class: "drop-files" });
  const machineLabel = element("label", { for: "drop-machine" });
  const machine = element("select", { id: "drop-machine" });
  const go = element("button", { type: "button" });
  const row = element("div", { class: "tools", hidden: true }, machineLabel, machine, go);
  const root = element("section", { class: "drop", hidden: true }, element("div", { class: "tools" }, words, choose, label), list, row);

  const draw = () => {
    setAttribute(root, "hidden", !store.mayPlan());
    setLines(words, [failure ? [t("failed", { reason: "" }), reasonOf(failure)] : [t("dropHere")]]);
    setText(label, t("choose"));
    setText(machineLabel, t("machine"));
    const waiting = files.filter((one) => one.state === "");
    setText(go, waiting.length === 1 ? t("createJob") : t("createJobs", { count: waiting.length }));
    setAttribute(go, "disabled", waiting.length === 0 || machine.value === "");
    setAttribute(row, "hidden", waiting.length === 0);
    keep(
      list, files, (one) => one.key,
      (one) => element("li", {}, element("span"), element("a"), element("button", { type: "button", class: "link", onclick: () => drop(one) })),
      (node, one) => {
        const [text, link, away] = node.children;
        const known = [one.file.name, bytes(one.file.size), one.error ? "" : one.state].filter(Boolean).join(" · ");
        setLines(text, [one.error ? [`${known} · `, reasonOf(one.error)] : [known]]);
        setText(link, one.job ? t("job") : "");
        setAttribute(link, "href", one.job ? `/${one.job}` : null);
        setAttribute(node, "data-failed", one.error !== undefined);
        setText(away, t("dismiss"));
      },
    );
  };
  const drop = (one) => {
    files = files.filter((other) => other !== one);
    draw();
  };
  let key = 0;
  const add = async (added) => {
    files.push(...[...added].slice(0, MOST_FILES - files.length).map((file) => ({ key: (key += 1), file, state: "" })));
    draw();
    if (machines.length > 0) return;
    try {
      machines = await readMachines(stop.signal);
      failure = null;
      machine.replaceChildren(...machines.map((one) => element("option", { value: one.name }, machineName(one))));
    } catch (error) {
      if (stop.signal.aborted) return;
      failure = error;
    }
    draw();
  };
  const create = async () => {
    const chosen = machine.value;
    for (const one of files.filter((each) => each.state === "")) {
      one.state = t("sending");
      draw();
      try {
        one.job = (await createJob(one.file, { machine: chosen, limits: store.limits(), signal: stop.signal })).name;
        one.state = t("created");
      } catch (error) {
        if (stop.signal.aborted) return;
        one.state = "failed";
        one.error = error;
      }
      draw();
    }
  };
  choose.addEventListener("change", () => {
    add(choose.files);
    choose.value = "";
  });
  go.addEventListener("click", create);
  return { root, draw, add, end: () => stop.abort() };
};
