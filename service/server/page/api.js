// What the service answers, and what it says by itself.

import { inEnglish } from "./dom.js";

const FIRST_PAUSE_MS = 2000;
const LONGEST_PAUSE_MS = 30000;
/** A stream that says nothing for so many heartbeats is dead. */
const SILENT_HEARTBEATS = 2.5;
/** Until it has said how often it says something. */
const FIRST_SILENCE_MS = 30000;
const LEAST_SILENCE_MS = 2500;

const ofSession = (key) => {
  try {
    return sessionStorage.getItem(key);
  } catch {
    // Asked for again with every page.
    return null;
  }
};

let token = ofSession("token");
/** The tenant that a client of all tenants looks at; empty: the default one. */
let tenant = ofSession("tenant") ?? "";

const keepForSession = (key, value) => {
  try {
    sessionStorage.setItem(key, value);
  } catch {
    // As above.
  }
};

export const setToken = (value) => {
  token = value;
  keepForSession("token", value);
};

export const setTenant = (value) => {
  tenant = value;
  keepForSession("tenant", value);
};

export const chosenTenant = () => tenant;

export const hasToken = () => token !== null;

/** Forgets who asks. */
export const forget = () => {
  try {
    ["token", "tenant"].forEach((key) => sessionStorage.removeItem(key));
  } catch {
    // Nothing is kept.
  }
};

/** Headers that say who asks, and for which tenant. */
export const identification = () => ({
  ...(token ? { authorization: `Bearer ${token}` } : {}),
  ...(tenant ? { "x-feedwave-tenant": tenant } : {}),
});

/** An answer that is none. */
export class Refused extends Error {
  constructor(status, message) {
    super(message);
    this.status = status;
  }
}

/** What went wrong, for a reader: what the service says is marked as English. */
export const reasonOf = (error) => (error instanceof Refused ? inEnglish(error.message) : error.message);

/** How far the clock of the service is ahead of the reader's, ms. */
let aheadMs = 0;
/** The service says its time in whole seconds, and an answer takes its way: less than that is no age. */
const LEAST_AGE_MS = 2000;

/** How old something is by the clock of the service, ms; 0 where it is fresh. */
export const oldMs = (time) => {
  const age = Date.now() + aheadMs - Date.parse(time);
  return age > LEAST_AGE_MS ? age : 0;
};

/** The time of the service, as exact as it says it, ms. */
export const serviceNow = () => Date.now() + (Math.abs(aheadMs) > LEAST_AGE_MS ? aheadMs : 0);

const request = async (path, headers = {}, signal = undefined) => {
  const response = await fetch(path, { headers: { ...headers, ...identification() }, signal, cache: "no-cache" });
  const time = Date.parse(response.headers.get("date") ?? "");
  if (Number.isFinite(time)) aheadMs = time - Date.now();
  if (response.ok) return response;
  let message = `${response.status}`;
  try {
    message = (await response.json()).message ?? message;
  } catch {
    // A proxy in between has other words.
  }
  throw new Refused(response.status, message);
};

/** The JSON at a path. */
export const read = async (path, signal) => (await request(path, {}, signal)).json();

/** The bytes at a path. */
export const readBytes = async (path, signal) => new Uint8Array(await (await request(path, {}, signal)).arrayBuffer());

/**
 * The stream of events: calls `on.state`, `on.gone`, `on.job`, `on.decision`, `on.reset`, `on.heartbeat`, `on.heard`, `on.open`,
 * `on.lost`, `on.refused`.
 */
export const follow = (on) => {
  let last = null;
  let pause = FIRST_PAUSE_MS;
  let silenceMs = FIRST_SILENCE_MS;
  const take = (block) => {
    let [event, data] = ["", ""];
    for (const line of block.split("\n")) {
      if (line.startsWith(": heartbeat ")) {
        const heartbeatMs = parseFloat(line.slice(12)) * 1000;
        silenceMs = Math.max(LEAST_SILENCE_MS, heartbeatMs * SILENT_HEARTBEATS);
        on.heartbeat(heartbeatMs);
      } else if (line.startsWith("id: ")) last = line.slice(4);
      else if (line.startsWith("event: ")) event = line.slice(7);
      else if (line.startsWith("data: ")) data += line.slice(6);
    }
    if (event && on[event]) on[event](JSON.parse(data));
  };
  const once = async () => {
    const stop = new AbortController();
    let silence = setTimeout(() => stop.abort(), FIRST_SILENCE_MS);
    silenceMs = FIRST_SILENCE_MS;
    try {
      const headers = { accept: "text/event-stream", ...(last === null ? {} : { "last-event-id": last }) };
      const response = await request("/v1/stream", headers, stop.signal);
      on.open();
      pause = FIRST_PAUSE_MS;
      const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
      let text = "";
      for (;;) {
        const { done, value } = await reader.read();
        if (done) return;
        clearTimeout(silence);
        text += value;
        const blocks = text.split("\n\n");
        text = blocks.pop();
        on.heard();
        blocks.forEach(take);
        silence = setTimeout(() => stop.abort(), silenceMs);
      }
    } finally {
      clearTimeout(silence);
    }
  };
  const forever = async () => {
    for (;;) {
      try {
        await once();
      } catch (error) {
        if (error instanceof Refused && (error.status === 401 || error.status === 403)) {
          on.refused(error);
          return;
        }
      }
      on.lost();
      await new Promise((resume) => setTimeout(resume, pause));
      pause = Math.min(LONGEST_PAUSE_MS, pause * 2);
    }
  };
  forever();
};

