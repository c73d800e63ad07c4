// SPDX-License-Identifier: Apache-2.0
// node page_sql.mjs PAGE.md FOLDER
// Goal: the SQL on a page of the documentation works. Method: DuckDB runs every statement of its sql blocks in FOLDER, which
// holds the files that the page speaks of; each must find at least one row.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';

const [page, folder] = process.argv.slice(2);
const statements = [...readFileSync(page, 'utf8').matchAll(/^```sql\n(.*?)^```/gms)].flatMap(([, block]) => block.split(';')).filter((statement) => statement.trim());
assert.ok(statements.length > 0, 'the page has SQL');
const { DuckDBInstance } = await import('@duckdb/node-api').catch((error) => {
  if (error.code !== 'ERR_MODULE_NOT_FOUND') throw error;
  console.error('SKIPPED: DuckDB is not installed');
  process.exit(77);
});
process.chdir(folder);
const connection = await (await DuckDBInstance.create(':memory:')).connect();
for (const statement of statements) {
  const rows = (await connection.runAndReadAll(statement)).getRowObjectsJS();
  assert.ok(rows.length > 0, statement);
}
console.log(`${statements.length} statements found rows`);
