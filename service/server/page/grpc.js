// Calls of the contract by gRPC-Web, on the origin of the page.

import { METHODS } from "./contract.js";
import { decode, encode } from "./protobuf.js";
import { Refused, identification } from "./api.js";

const TYPE = "application/grpc-web+proto";
/** Behind the head of a frame comes the message. */
const HEAD_BYTES = 5;
const MOST_FRAME_BYTES = 64 << 20;
const TRAILERS = 0x80;
/** Codes of gRPC as statuses of HTTP, which the other answers have. */
const HTTP_STATUS = { 3: 400, 5: 404, 7: 403, 9: 400, 16: 401 };

const frame = (bytes) => {
  const head = new Uint8Array(HEAD_BYTES);
  new DataView(head.buffer).setUint32(1, bytes.length);
  return [head, bytes];
};

const refusal = (status, message) => {
  const code = Number(status);
  let text = message ?? "";
  try {
    text = decodeURIComponent(text);
  } catch {
    // Shown as it came.
  }
  return new Refused(HTTP_STATUS[code] ?? 503, text || `gRPC ${status}`);
};

const trailersOf = (bytes) =>
  new Map(new TextDecoder().decode(bytes).split("\r\n").filter((line) => line.includes(":"))
    .map((line) => [line.slice(0, line.indexOf(":")).toLowerCase(), line.slice(line.indexOf(":") + 1).trim()]));

/** Frames of a body as they come: calls `take` with the flags and the bytes of each. */
const readFrames = async (body, take) => {
  const reader = body.getReader();
  let rest = new Uint8Array(0);
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    let bytes = value;
    if (rest.length > 0) {
      bytes = new Uint8Array(rest.length + value.length);
      bytes.set(rest);
      bytes.set(value, rest.length);
    }
    let at = 0;
    while (bytes.length - at >= HEAD_BYTES) {
      const length = new DataView(bytes.buffer, bytes.byteOffset + at, HEAD_BYTES).getUint32(1);
      if (length > MOST_FRAME_BYTES) throw new RangeError("an answer is too large");
      if (bytes.length - at - HEAD_BYTES < length) break;
      take(bytes[at], bytes.subarray(at + HEAD_BYTES, at + HEAD_BYTES + length));
      at += HEAD_BYTES + length;
    }
    rest = bytes.slice(at);
  }
};

/**
 * Calls a method, `Jobs/ValidateProgram`, with one message or a list of them. `onMessage` is given each answer as it comes;
 * what is returned is the last one. An aborted `signal` ends the call, here and at the service.
 */
export const call = async (method, request, { signal, onMessage } = {}) => {
  const path = `/feedwave.v1.${method}`;
  const [input, output] = METHODS[path];
  const requests = Array.isArray(request) ? request : [request];
  const body = new Blob(requests.flatMap((one) => frame(encode(input, one))));
  const headers = { ...identification(), "content-type": TYPE, "x-grpc-web": "1" };
  const response = await fetch(path, { method: "POST", headers, body, signal, cache: "no-store" });
  const status = response.headers.get("grpc-status");
  if (status !== null && status !== "0") throw refusal(status, response.headers.get("grpc-message"));
  if (!response.ok) throw new Refused(response.status, `${response.status}`);
  let last = null;
  let trailers = new Map();
  await readFrames(response.body, (flags, bytes) => {
    if (flags & TRAILERS) trailers = trailersOf(bytes);
    else {
      last = decode(output, bytes);
      onMessage?.(last);
    }
  });
  const ended = trailers.get("grpc-status") ?? status;
  if (ended === undefined || ended === null) throw new Refused(503, "the answer ended too soon");
  if (ended !== "0") throw refusal(ended, trailers.get("grpc-message"));
  return last;
};
