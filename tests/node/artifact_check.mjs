// SPDX-License-Identifier: Apache-2.0
// node artifact_check.mjs ARTIFACT_DIR
// Reads rollouts.parquet with two independent readers, hyparquet and (where installed) DuckDB, and finds in every column
// of every row what rollouts.jsonl says; and the types that the schema file says.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { parquetMetadata, parquetReadObjects } from 'hyparquet';

const folder = process.argv[2];
const lines = readFileSync(`${folder}/rollouts.jsonl`, 'utf8').trimEnd().split('\n').map((line) => JSON.parse(line));
const schema = JSON.parse(readFileSync(`${folder}/rollout.schema.json`, 'utf8'));
const manifest = JSON.parse(readFileSync(`${folder}/manifest.json`, 'utf8'));

function flat(value, prefix = '', out = {}) {
  for (const [key, each] of Object.entries(value)) {
    if (each !== null && typeof each === 'object') flat(each, `${prefix}${key}_`, out);
    else out[prefix + key] = each;
  }
  return out;
}
const expected = lines.map((line) => flat(line));
const plain = (value) => (typeof value === 'bigint' ? Number(value) : value);

const bytes = readFileSync(`${folder}/rollouts.parquet`);
const file = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
const metadata = parquetMetadata(file);
assert.equal(Number(metadata.num_rows), lines.length);
assert.deepEqual(Object.fromEntries(metadata.key_value_metadata.map(({ key, value }) => [key, value])),
  { 'takt.row_schema': schema.title, 'takt.artifact_id': manifest.artifact_id });
assert.deepEqual(metadata.schema.slice(1).map((column) => column.name), Object.keys(expected[0]));

// The file's type of every column against the JSON Schema's.
function schemaTypes(object, prefix = '', out = {}) {
  for (const [key, each] of Object.entries(object.properties)) {
    if (each.type === 'object') schemaTypes(each, `${prefix}${key}_`, out);
    else out[prefix + key] = [each.type ?? 'string'].flat();
  }
  return out;
}
const physical = { boolean: 'BOOLEAN', integer: 'INT64', number: 'DOUBLE', string: 'BYTE_ARRAY' };
const types = schemaTypes(schema);
for (const column of metadata.schema.slice(1)) {
  assert.equal(column.type, physical[types[column.name][0]], column.name);
  assert.equal(column.repetition_type, types[column.name].includes('null') ? 'OPTIONAL' : 'REQUIRED', column.name);
}

const rows = await parquetReadObjects({ file });
assert.deepEqual(rows.map((row) => Object.fromEntries(Object.entries(row).map(([k, v]) => [k, plain(v)]))), expected);

let duck = 'DuckDB is not installed';
try {
  const { DuckDBInstance } = await import('@duckdb/node-api');
  const connection = await (await DuckDBInstance.create(':memory:')).connect();
  const result = await connection.runAndReadAll(`SELECT * FROM read_parquet('${folder}/rollouts.parquet')`);
  const read = result.getRowObjectsJS();
  assert.deepEqual(read.map((row) => Object.fromEntries(Object.entries(row).map(([k, v]) => [k, plain(v)]))), expected);
  duck = 'DuckDB agrees';
} catch (error) {
  if (error.code !== 'ERR_MODULE_NOT_FOUND') throw error;
}
console.log(`${rows.length} rows of ${metadata.schema.length - 1} columns; ${duck}`);
