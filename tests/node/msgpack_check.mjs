// SPDX-License-Identifier: Apache-2.0
// node msgpack_check.mjs <ASKED >ANSWERED
// A third party's MessagePack between Takt's policy clients and a test (tests/client/msgpack_vectors_test.py). ASKED, JSON: {decode: [hex],
// encode: [value]}; ANSWERED: {decoded: [value], encoded: [hex]}. Bytes are {"bin": hex} in both; a key of bytes reads "bin:TEXT".
// It cannot write keys of bytes, which openpi's arrays have: JavaScript's objects have none.
import { decode, encode } from '@msgpack/msgpack';
import { readFileSync } from 'node:fs';

const hex = (bytes) => Buffer.from(bytes).toString('hex');
const mapKeyConverter = (key) => (key instanceof Uint8Array ? `bin:${Buffer.from(key).toString()}` : key);

function toJson(value) {
  if (value instanceof Uint8Array) return { bin: hex(value) };
  if (Array.isArray(value)) return value.map(toJson);
  if (value === null || typeof value !== 'object') return value;
  return Object.fromEntries(Object.entries(value).map(([key, inner]) => [key, toJson(inner)]));
}

function fromJson(value) {
  if (Array.isArray(value)) return value.map(fromJson);
  if (value === null || typeof value !== 'object') return value;
  if ('bin' in value) return Uint8Array.from(Buffer.from(value.bin, 'hex'));
  return Object.fromEntries(Object.entries(value).map(([key, inner]) => [key, fromJson(inner)]));
}

const asked = JSON.parse(readFileSync(0, 'utf8'));
process.stdout.write(JSON.stringify({
  decoded: asked.decode.map((message) => toJson(decode(Buffer.from(message, 'hex'), { mapKeyConverter }))),
  encoded: asked.encode.map((value) => hex(encode(fromJson(value)))),
}));
