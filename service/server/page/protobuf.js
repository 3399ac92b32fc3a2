// Messages of the contract from and to bytes, by the table that the service makes from the contract (contract.js). What is
// read looks like the JSON of the HTTP routes: names of enums, wide integers as texts, what is absent left out.

import { ENUMS, MESSAGES } from "./contract.js";

const WIRE = { double: 1, float: 5, string: 2, bytes: 2, message: 2 };
const EMPTY = { double: 0, float: 0, int32: 0, uint32: 0, int64: "0", sint64: "0", uint64: "0", bool: false, string: "" };
const LIST = 2;
const ALWAYS = 0;

const utf8 = new TextDecoder();
const toUtf8 = new TextEncoder();

/** How a message is read: its fields by number, and what those have that are not there. */
const readers = new Map();
const readerOf = (name) => {
  let reader = readers.get(name);
  if (!reader) {
    const fields = [];
    const empty = {};
    for (const [number, key, kind, label, type] of MESSAGES[name]) {
      fields[number] = { key, kind, isList: label === LIST, type };
      if (label === LIST) empty[key] = null;
      else if (label === ALWAYS && kind !== "message") empty[key] = kind === "enum" ? ENUMS[type][0] : kind === "bytes" ? new Uint8Array(0) : EMPTY[kind];
    }
    const lists = fields.filter((field) => field.isList).map((field) => field.key);
    reader = { fields, empty, lists };
    readers.set(name, reader);
  }
  return reader;
};

class Input {
  constructor(bytes) {
    this.bytes = bytes;
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    this.at = 0;
  }

  /** An unsigned number of up to 53 bits; a bigint beyond. */
  varint() {
    let [value, factor] = [0, 1];
    for (let read = 0; read < 7; read += 1) {
      const byte = this.bytes[this.at];
      if (byte === undefined) throw new RangeError("a message ends too soon");
      this.at += 1;
      value += (byte & 127) * factor;
      if (byte < 128) return value;
      factor *= 128;
    }
    let wide = BigInt(value);
    for (let shift = 49n; shift < 70n; shift += 7n) {
      const byte = this.bytes[this.at];
      this.at += 1;
      wide |= BigInt(byte & 127) << shift;
      if (byte < 128) return wide;
    }
    throw new RangeError("a number is too long");
  }

  length() {
    const length = Number(this.varint());
    if (length > this.bytes.length - this.at) throw new RangeError("a message ends too soon");
    return length;
  }

  skip(wire) {
    if (wire === 0) this.varint();
    else if (wire === 1) this.at += 8;
    else if (wire === 2) {
      const length = this.length();
      this.at += length;
    }
    else if (wire === 5) this.at += 4;
    else throw new RangeError(`no message has wire type ${wire}`);
  }

  value(kind, type) {
    switch (kind) {
      case "double":
        this.at += 8;
        return this.view.getFloat64(this.at - 8, true);
      case "float":
        this.at += 4;
        return this.view.getFloat32(this.at - 4, true);
      case "bool":
        return this.varint() !== 0;
      case "uint32":
        return this.varint();
      case "int32":
        return Number(BigInt.asIntN(32, BigInt(this.varint())));
      case "uint64":
        return String(this.varint());
      case "int64":
        return String(BigInt.asIntN(64, BigInt(this.varint())));
      case "sint64": {
        const folded = BigInt(this.varint());
        return String(folded & 1n ? -(folded >> 1n) - 1n : folded >> 1n);
      }
      case "enum": {
        const number = this.varint();
        return ENUMS[type][number] ?? String(number);
      }
      default: {
        const length = this.length();
        const part = this.bytes.subarray(this.at, this.at + length);
        this.at += length;
        if (kind === "string") return utf8.decode(part);
        return kind === "bytes" ? part : decode(type, part);
      }
    }
  }
}

/** A message by its name, from its bytes. */
export const decode = (name, bytes) => {
  const { fields, empty, lists } = readerOf(name);
  const message = { ...empty };
  for (const key of lists) message[key] = [];
  const input = new Input(bytes);
  while (input.at < bytes.length) {
    const tag = input.varint();
    const wire = tag & 7;
    const field = fields[tag >>> 3];
    if (!field) input.skip(wire);
    else if (!field.isList) message[field.key] = input.value(field.kind, field.type);
    else if (wire === 2 && !(WIRE[field.kind] === 2)) {
      // Numbers of a list come together.
      const length = input.length();
      const end = input.at + length;
      while (input.at < end) message[field.key].push(input.value(field.kind, field.type));
    } else message[field.key].push(input.value(field.kind, field.type));
  }
  return message;
};

const varint = (out, number) => {
  let rest = number;
  while (rest > 127) {
    out.push((rest % 128) | 128);
    rest = Math.floor(rest / 128);
  }
  out.push(rest);
};

/** The bytes of one value behind its tag, as parts. */
const valueParts = (kind, type, value) => {
  const out = [];
  if (kind === "double") return [new Uint8Array(new Float64Array([value]).buffer)];
  if (WIRE[kind] !== 2) {
    varint(out, kind === "bool" ? Number(value) : kind === "enum" ? Number(Object.keys(ENUMS[type]).find((number) => ENUMS[type][number] === value)) : Number(value));
    return [new Uint8Array(out)];
  }
  const parts = kind === "message" ? encodeParts(type, value) : [kind === "string" ? toUtf8.encode(value) : value];
  varint(out, parts.reduce((sum, part) => sum + part.length, 0));
  return [new Uint8Array(out), ...parts];
};

const encodeParts = (name, message) => {
  const parts = [];
  for (const [number, key, kind, label, type] of MESSAGES[name]) {
    const value = message[key];
    if (value === undefined || value === null) continue;
    for (const one of label === LIST ? value : [value]) {
      const tag = [];
      varint(tag, number * 8 + (WIRE[kind] ?? 0));
      parts.push(new Uint8Array(tag), ...valueParts(kind, type, one));
    }
  }
  return parts;
};

/** The bytes of a message by its name; fields are those of its JSON. Nothing negative is sent, and no float. */
export const encode = (name, message) => {
  const parts = encodeParts(name, message);
  const bytes = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
  let at = 0;
  for (const part of parts) {
    bytes.set(part, at);
    at += part.length;
  }
  return bytes;
};
