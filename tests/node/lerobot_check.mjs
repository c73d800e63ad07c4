// SPDX-License-Identifier: Apache-2.0
// node lerobot_check.mjs FOLDER
// FOLDER/set is a LeRobot data set of the runs FOLDER/one and FOLDER/two. Reads it with two independent readers of
// Parquet, hyparquet and (where installed) DuckDB, as the format says it is laid out, and finds in every frame what the
// runs' ticks and commands say, read by MCAP's reference library. Statistics are computed again.
import assert from 'node:assert/strict';
import { readFileSync, readdirSync } from 'node:fs';
import { McapStreamReader } from '@mcap/core';
import { loadDecompressHandlers } from '@mcap/support';
import { parse } from '@foxglove/rosmsg';
import { MessageReader } from '@foxglove/rosmsg2-serialization';
import { parquetMetadata, parquetReadObjects } from 'hyparquet';

const folder = process.argv[2];
const set = `${folder}/set`;
const json = (path) => JSON.parse(readFileSync(path, 'utf8'));
const decompressHandlers = await loadDecompressHandlers();

// What a run's decision saw and heard.
function recorded(run) {
  const reader = new McapStreamReader({ decompressHandlers });
  reader.append(readFileSync(`${run}/ticks.mcap`));
  const schemas = new Map(), channels = new Map(), found = { ticks: [], commands: new Map(), joints: json(`${run}/manifest.json`).joints };
  for (let record; (record = reader.nextRecord()) !== undefined;) {
    if (record.type === 'Schema') schemas.set(record.id, new MessageReader(parse(new TextDecoder().decode(record.data), { ros2: true })));
    if (record.type === 'Channel') channels.set(record.id, record);
    if (record.type !== 'Message') continue;
    const { topic, schemaId } = channels.get(record.channelId);
    if (topic === '/takt/tick') found.ticks.push(schemas.get(schemaId).readMessage(record.data));
    if (topic !== '/takt/command') continue;
    const command = schemas.get(schemaId).readMessage(record.data);
    found.commands.set(command.sequence, command);
  }
  return found;
}
const runs = [recorded(`${folder}/one`), recorded(`${folder}/two`)];

const info = json(`${set}/meta/info.json`);
const origin = json(`${set}/meta/takt.json`);
const joints = runs[0].joints;
assert.equal(info.codebase_version, 'v3.0');
assert.equal(info.fps, 50);
assert.deepEqual(info.splits, { train: `0:${info.total_episodes}` });
assert.equal(info.video_path, null);
assert.deepEqual(info.features['observation.state'], { dtype: 'float32', shape: [12],
  names: [...joints.map((name) => `${name}.pos`), ...joints.map((name) => `${name}.vel`)], units: [...joints.map(() => 'rad'), ...joints.map(() => 'rad/s')] });
assert.deepEqual(info.features.action, { dtype: 'float32', shape: [6], names: joints.map((name) => `${name}.pos`), units: joints.map(() => 'rad') });
assert.deepEqual(info.features.timestamp, { dtype: 'float32', shape: [1], names: null });
for (const name of ['frame_index', 'episode_index', 'index', 'task_index'])
  assert.deepEqual(info.features[name], { dtype: 'int64', shape: [1], names: null });

function open(path) {
  const bytes = readFileSync(path);
  return bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
}
const plain = (value) => (typeof value === 'bigint' ? Number(value) : Array.isArray(value?.items ?? value) ? [...(value.items ?? value)].map(plain) : value);
const plainRow = (row) => Object.fromEntries(Object.entries(row).map(([key, value]) => [key, plain(value)]));
const read = async (path) => (await parquetReadObjects({ file: open(path) })).map(plainRow);

// Tasks: pandas takes the text for the index, and so finds the number by it.
const tasks = parquetMetadata(open(`${set}/meta/tasks.parquet`));
const pandas = JSON.parse(tasks.key_value_metadata.find(({ key }) => key === 'pandas').value);
assert.deepEqual(pandas.index_columns, ['task']);
assert.deepEqual(pandas.columns.map(({ field_name }) => field_name), tasks.schema.slice(1).map(({ name }) => name));
assert.deepEqual(await read(`${set}/meta/tasks.parquet`), [{ task_index: 0, task: 'follow the "target"' }]);

const episodes = await read(`${set}/meta/episodes/chunk-000/file-000.parquet`);
assert.equal(episodes.length, info.total_episodes);
assert.equal(origin.episodes.length, info.total_episodes);
assert.ok(new Set(episodes.map((episode) => episode['data/file_index'])).size > 1, 'several data files');
const pathOf = (episode) => `${set}/${info.data_path.replace('{chunk_index:03d}', String(episode['data/chunk_index']).padStart(3, '0'))
  .replace('{file_index:03d}', String(episode['data/file_index']).padStart(3, '0'))}`;
const paths = [...new Set(episodes.map(pathOf))];
assert.deepEqual(paths, readdirSync(`${set}/data/chunk-000`).map((name) => `${set}/data/chunk-000/${name}`));

// Each frame against the tick that published its observation, and the step that this tick played.
const frames = [];
for (const path of paths) {
  const metadata = parquetMetadata(open(path));
  const within = episodes.filter((episode) => pathOf(episode) === path);
  assert.deepEqual(metadata.row_groups.map((group) => Number(group.num_rows)), within.map(({ length }) => length), 'a row group per episode');
  assert.deepEqual(metadata.schema.filter((element) => element.type !== undefined).map(({ type }) => type), ['FLOAT', 'FLOAT', 'FLOAT', 'INT64', 'INT64', 'INT64', 'INT64']);
  frames.push(...await read(path));
}
assert.equal(frames.length, info.total_frames);
for (const [number, episode] of episodes.entries()) {
  const { first_tick, last_tick, run_id } = origin.episodes[number];
  assert.equal(run_id, 'virtual');
  const run = runs[number < 2 ? 0 : 1];
  const published = run.ticks.filter(({ tick, observation_published }) => observation_published && tick >= first_tick && tick <= last_tick);
  assert.equal(episode.episode_index, number);
  assert.deepEqual(episode.tasks, ['follow the "target"']);
  assert.equal(published.length, episode.length);
  assert.equal(episode.dataset_to_index - episode.dataset_from_index, episode.length);
  assert.equal(episode.dataset_from_index, number === 0 ? 0 : episodes[number - 1].dataset_to_index);
  for (const [index, tick] of published.entries()) {
    const frame = frames[episode.dataset_from_index + index];
    const command = run.commands.get(tick.command_sequence);
    const step = Number(tick.chunk_step) * joints.length;
    assert.equal(tick.mode, 2, 'tracking');
    assert.deepEqual(frame['observation.state'], [...tick.q_estimate, ...tick.dq_estimate]);
    assert.deepEqual(frame.action, [...command.values.slice(step, step + joints.length)]);
    assert.deepEqual([frame.timestamp, frame.frame_index, frame.episode_index, frame.index, frame.task_index],
      [Math.fround(index / info.fps), index, number, episode.dataset_from_index + index, 0]);
  }
}

// Statistics, of the set and of each episode.
const near = (found, wanted, what) => assert.ok(Math.abs(found - wanted) <= 1e-9 * Math.max(1, Math.abs(wanted)), `${what}: ${found}, not ${wanted}`);
function checkStatistics(statistics, of, what) {
  for (const name of Object.keys(info.features)) {
    const rows = of.map((frame) => [frame[name]].flat());
    assert.deepEqual(statistics(name, 'count'), [of.length], what);
    for (let place = 0; place < rows[0].length; ++place) {
      const column = rows.map((row) => row[place]).sort((a, b) => a - b);
      const mean = column.reduce((sum, value) => sum + value, 0) / column.length;
      const quantile = (share) => { const at = share * (column.length - 1), low = Math.floor(at);
        return column[low] + (at - low) * ((column[low + 1] ?? column[low]) - column[low]); };
      const wanted = { min: column[0], max: column.at(-1), mean, std: Math.sqrt(column.reduce((sum, value) => sum + (value - mean) ** 2, 0) / column.length),
        q01: quantile(0.01), q10: quantile(0.1), q50: quantile(0.5), q90: quantile(0.9), q99: quantile(0.99) };
      for (const [key, value] of Object.entries(wanted)) near(statistics(name, key)[place], value, `${what} ${name}[${place}] ${key}`);
    }
  }
}
const stats = json(`${set}/meta/stats.json`);
checkStatistics((name, key) => stats[name][key], frames, 'set');
for (const episode of episodes)
  checkStatistics((name, key) => episode[`stats/${name}/${key}`], frames.slice(episode.dataset_from_index, episode.dataset_to_index), `episode ${episode.episode_index}`);

let duck = 'DuckDB is not installed';
try {
  const { DuckDBInstance } = await import('@duckdb/node-api');
  const connection = await (await DuckDBInstance.create(':memory:')).connect();
  const query = async (sql) => (await connection.runAndReadAll(sql)).getRowObjectsJS().map(plainRow);
  assert.deepEqual(await query(`SELECT * FROM read_parquet('${set}/data/*/*.parquet') ORDER BY "index"`), frames);
  assert.deepEqual(await query(`SELECT * FROM read_parquet('${set}/meta/episodes/*/*.parquet')`), episodes);
  const [{ q01 }] = await query(`SELECT quantile_cont("action"[2]::DOUBLE, 0.01) AS q01 FROM read_parquet('${set}/data/*/*.parquet')`);
  near(q01, stats.action.q01[1], 'DuckDB q01');
  duck = 'DuckDB agrees';
} catch (error) {
  if (error.code !== 'ERR_MODULE_NOT_FOUND') throw error;
}
console.log(`${frames.length} frames of ${episodes.length} episodes in ${paths.length} files; ${duck}`);
