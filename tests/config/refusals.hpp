// SPDX-License-Identifier: Apache-2.0
// Every way to get a robot file wrong that the loader knows, with the complaint it must give: the small robot with
// `from` replaced by `to`, the problems' "line:column: what; how to correct it", one per line. The lines were read and
// judged one by one; a changed wording changes here too.
#pragma once

#include <ostream>
#include <string_view>

namespace takt::config::test {

struct Refusal {
  std::string_view when;
  std::string_view from, to;
  std::string_view complaint;
  friend void PrintTo(const Refusal& refusal, std::ostream* out) { *out << refusal.when; }
};

inline constexpr Refusal kRefusals[] = {
    Refusal{"an unknown key, near a known one", "max_age: 120 ms", "max_agee: 120 ms",
            "5:3: key `max_age` is missing in `freshness`; add it: a command older than this is not played\n"
            "5:3: unknown key `max_agee` in `freshness`; did you mean `max_age`?"},
    Refusal{"an unknown key, near none", "epsilon: 0.01", "epsilon: 0.01\n  colour: red",
            "7:3: unknown key `colour` in `freshness`; known here: max_age, aging_fraction, epsilon, confidence, "
            "window, recover_after, flap_memory, stop_after, bad_command_limit, clamped_share"},
    Refusal{
        "a key of an earlier version", "spin: 100 us }", "spin: 100 us, overrun_limit: 50 }",
        "3:78: control.overrun_limit: gone since version 0.2: write control.late_share: the share of "
        "freshness.window's "
        "periods that may be late, 0.25 where it is left out; consecutive late ticks alone are not counted any more"},
    Refusal{"an unknown key at the top", "robot: small", "robot: small\nrobots: 2",
            "3:1: unknown key `robots` at the top; did you mean `robot`?"},
    Refusal{"a duplicate key", "epsilon: 0.01", "epsilon: 0.01\n  epsilon: 0.02",
            "7:3: duplicate key `epsilon`, first written in line 6; keep one of the two"},
    Refusal{"a duplicate section", "sensors:", "feedback: { timeout: 30 ms }\nsensors:",
            "44:1: duplicate key `feedback`, first written in line 10; keep one of the two"},
    Refusal{"a missing key", "  max_age: 120 ms\n", "",
            "5:3: key `max_age` is missing in `freshness`; add it: a command older than this is not played"},
    Refusal{"a missing key in a list entry", "    bus: left\n    drive", "    drive",
            "17:5: key `bus` is missing in `joints[0]`; add it: bus of its drive"},
    Refusal{"a missing section", "feedback: { timeout: 20 ms }\n", "",
            "1:1: key `feedback` is missing; add it: what the drives owe"},
    Refusal{"a quantity without its unit", "120 ms", "120",
            "5:12: freshness.max_age: 120 has no unit; write `120 ms` or `120 s`"},
    Refusal{"a quantity of another dimension", "torque: 12 Nm", "torque: 12 rad",
            "26:15: joints[0].limits.torque: 12 rad is an angle, not a torque; write it in Nm"},
    Refusal{"a force for a torque", "torque: 12 Nm", "torque: 12 N",
            "26:15: joints[0].limits.torque: 12 N is a force, not a torque; write it in Nm, or write `kind: slide` "
            "into the "
            "joint"},
    Refusal{"an abbreviation that is no unit", "torque: 12 Nm", "torque: 12 nm",
            "26:15: joints[0].limits.torque: 12 nm is not a torque; write it in Nm"},
    Refusal{"a unit in the wrong case", "120 ms", "120 MS",
            "5:12: freshness.max_age: 120 MS is not a time; write it in ns or us or ms or s or min or h"},
    Refusal{"two spaces before the unit", "120 ms", "120  ms",
            "5:12: freshness.max_age: 120  ms is not a time; write it in ns or us or ms or s or min or h"},
    Refusal{"a word for a quantity", "120 ms", "soon",
            "5:12: freshness.max_age: `soon` is not a time; write a number and ns or us or ms or s or min or h"},
    Refusal{"a decimal comma", "epsilon: 0.01", "epsilon: \"0,01\"",
            "6:12: freshness.epsilon: \"0,01\" is text; write the number without quotes"},
    Refusal{
        "an observed quaternion without its order", "term: last_action }", "term: base_orientation }",
        "56:7: key `order` is missing in `policy.observation[3]`; add it: base_orientation: order of the quaternion"},
    Refusal{"an orientation that nothing measures", "term: last_action }", "term: base_orientation, order: xyzw }",
            "56:15: policy.observation[3].term: the robot has no IMU that says it; add `imu`"},
    Refusal{"a clip that is no range", "term: last_action }", "term: last_action, clip: [1, -1] }",
            "56:34: policy.observation[3].clip: is no range; write [lowest, highest]"},
    Refusal{"means of another number", "term: last_action }", "term: last_action, mean: [1, 2, 3] }",
            "56:34: policy.observation[3].mean: has 3 values for a term of 2; write one, or 2"},
    Refusal{"a standard deviation of zero", "term: last_action }", "term: last_action, std: 0 }",
            "56:33: policy.observation[3].std: 0 is out of range; write above 0 and at most 1000000000"},
    Refusal{
        "a scaled motion reference", "term: last_action }",
        "term: motion_reference, output: joint_pos, count: 2, scale: 2 }",
        "56:7: policy.observation[3]: motion_reference is shown as the network gives it; drop scale, clip, mean, std "
        "and history"},
    Refusal{"velocities beside straight lines", "offset: home }", "offset: home, outputs: { velocity: v } }",
            "57:11: policy.action.interpolation: linear draws its own velocities; write hold or cubic, or drop "
            "policy.action.outputs.velocity"},
    Refusal{"a torque beside torques", "offset: home }",
            "offset: zero, kind: joint_torque, interpolation: hold, outputs: { torque: t } }",
            "57:107: policy.action.outputs.torque: the action says the torque itself; drop it"},
    Refusal{"min above max", "[-1 rad, 1 rad]", "[1 rad, -1 rad]",
            "21:17: joints[0].limits.position: min 1 rad is not below max -1 rad; swap them or widen the range"},
    Refusal{"min equal to max", "[-1 rad, 1 rad]", "[1 rad, 1 rad]",
            "21:17: joints[0].limits.position: min 1 rad is not below max 1 rad; swap them or widen the range"},
    Refusal{"a range of three", "[-1 rad, 1 rad]", "[-1 rad, 0 rad, 1 rad]",
            "21:17: joints[0].limits.position: has 3 values; write two: [min, max]"},
    Refusal{"an octal-looking integer", "priority: 80", "priority: 010",
            "3:36: control.priority: 010 reads as octal in YAML; write 10"},
    Refusal{"an octal-looking quantity", "120 ms", "0120 ms",
            "5:12: freshness.max_age: 0120 reads as octal in YAML; write 120"},
    Refusal{"a YAML 1.2 octal", "priority: 80", "priority: 0o17",
            "3:36: control.priority: `0o17` is not a number; write a whole one, 1 to 99"},
    Refusal{"an octal-looking CAN id", "id: 0x02", "id: 02",
            "34:50: joints[1].drive.id: 02 reads as octal in YAML; write 2"},
    Refusal{"a boolean by accident for a flag", "when_missing: loopback }", "when_missing: loopback, fd: no }",
            "15:64: buses[0].fd: `no` is not a boolean here; write true or false"},
    Refusal{"a boolean by accident for a name", "name: left,", "name: no,",
            "15:13: buses[0].name: `no` reads as a boolean in YAML; choose another name\n"
            "18:10: joints[0].bus: bus `left` is not known; write one of: no\n"
            "33:10: joints[1].bus: bus `left` is not known; write one of: no"},
    Refusal{"a boolean by accident for a text", "file: small.onnx", "file: on",
            "47:9: policy.file: `on` reads as a boolean in YAML; put it in quotes: \"on\""},
    Refusal{"a number for a flag", "when_missing: loopback }", "when_missing: loopback, fd: 1 }",
            "15:64: buses[0].fd: `1` is not a boolean here; write true or false"},
    Refusal{"too few values in a pose", "[0 rad, 10 deg]", "[0 rad]",
            "13:47: fallbacks.tuck.pose: has 1 values for 2 joints; write one per joint"},
    Refusal{"too many values in a pose", "[0 rad, 10 deg]", "[0 rad, 10 deg, 0 rad]",
            "13:47: fallbacks.tuck.pose: has 3 values for 2 joints; write one per joint"},
    Refusal{"a pose outside the limits", "[0 rad, 10 deg]", "[0 rad, 100 deg]",
            "13:47: fallbacks.tuck.pose: 1.745 rad for knee is outside its limits [-1.571, 1.571] rad; move it inside"},
    Refusal{"a fallback faster than a joint", "speed: 0.5 rad/s", "speed: 2.5 rad/s",
            "13:30: fallbacks.tuck.speed: 2.5 rad/s exceeds the velocity limit 2 rad/s of hip; lower it"},
    Refusal{"a fallback policy without its time", "kind: pose, speed: 0.5 rad/s, pose: [0 rad, 10 deg]", "kind: policy",
            "13:9: key `for` is missing in `fallbacks.tuck`; add it: policy: damped stop after moving the robot this "
            "long; 0 s: never"},
    Refusal{"a command that the fallback policy does not read", "kind: pose, speed: 0.5 rad/s, pose: [0 rad, 10 deg]",
            "kind: policy, for: 0 s, command: [0]",
            "13:44: fallbacks.tuck.command: the policy has no observation term `command`; drop it"},
    Refusal{
        "degraded only after the stop", "fallback: tuck }", "fallback: tuck, after: 600 ms }",
        "11:57: degraded.after: 600 ms is not shorter than freshness.stop_after 600 ms: the robot would stop before; "
        "lower it"},
    Refusal{"too few action scales", "scale: [0.25, 0.5]", "scale: [0.25, 0.5, 1]",
            "57:20: policy.action.scale: has 3 values for 2 outputs; write one, or 2"},
    Refusal{"too few observation scales", "scale: [1, 1, 0.5]", "scale: [1, 1]",
            "54:46: policy.observation[1].scale: has 2 values for a term of 3; write one, or 3"},
    Refusal{"not a number", "epsilon: 0.01", "epsilon: nan",
            "6:12: freshness.epsilon: nan is not finite; write a real number"},
    Refusal{"YAML's not a number", "epsilon: 0.01", "epsilon: .nan",
            "6:12: freshness.epsilon: `.nan` is not a number; write digits such as 0.5 or 1e-3"},
    Refusal{"infinity", "120 ms", "inf ms", "5:12: freshness.max_age: inf is not finite; write a real number"},
    Refusal{"an overflowing number", "120 ms", "1e999 ms", "5:12: freshness.max_age: 1e999 is too large or too small"},
    Refusal{"out of range, open end", "epsilon: 0.01", "epsilon: 1",
            "6:12: freshness.epsilon: 1 is out of range; write above 0 and below 1"},
    Refusal{"out of range, negative", "torque: 12 Nm", "torque: -12 Nm",
            "26:15: joints[0].limits.torque: -12 Nm is out of range; write above 0 Nm and at most 100000 Nm"},
    Refusal{"out of range, whole", "priority: 80", "priority: 100",
            "3:36: control.priority: 100 is out of range; write 1 to 99"},
    Refusal{"a fraction for a whole number", "priority: 80", "priority: 80.5",
            "3:36: control.priority: 80.5 is not a whole number; write one such as 3"},
    Refusal{"a number in quotes", "priority: 80", "priority: \"80\"",
            "3:36: control.priority: \"80\" is text; write the number without quotes"},
    Refusal{"a text for a whole number", "priority: 80", "priority: high",
            "3:36: control.priority: `high` is not a number; write a whole one, 1 to 99"},
    Refusal{"an unknown bus, near a known one", "bus: left", "bus: lef",
            "18:10: joints[0].bus: bus `lef` is not known; did you mean `left`?"},
    Refusal{"an unknown bus, near none", "bus: left", "bus: starboard",
            "18:10: joints[0].bus: bus `starboard` is not known; write one of: left"},
    Refusal{"an unknown sensor", "sensor: target, scale", "sensor: imu, scale",
            "54:31: policy.observation[1].sensor: sensor `imu` is not known; write one of: target"},
    Refusal{"limits of a command swapped", "timeout: 100 ms }",
            "timeout: 100 ms, command: { minimum: [0, 0.6, 0], maximum: [1, -0.6, 1], when_absent: [0, 0, 0] } }",
            "45:69: sensors[0].command.minimum: value 2 is 0.6, above the maximum -0.6; swap them"},
    Refusal{"a fallback that sounds like none", "fallback: tuck }", "fallback: home }",
            "11:44: degraded.fallback: fallback `home` is not known; write one of: tuck, none"},
    Refusal{"a behaviour that looks like another", "behaviour: fallback", "behaviour: stop",
            "11:24: degraded.behaviour: behaviour `stop` is not known; write one of: hold, slow, fallback"},
    Refusal{"two letters swapped", "behaviour: fallback", "behaviour: hodl",
            "11:24: degraded.behaviour: behaviour `hodl` is not known; did you mean `hold`?"},
    Refusal{"an unknown fallback", "fallback: tuck }", "fallback: stand }",
            "11:44: degraded.fallback: fallback `stand` is not known; write one of: tuck, none"},
    Refusal{
        "an unknown drive model", "AK10-9", "AK10-99",
        "19:53: joints[0].drive.model: drive model `AK10-99` is not known: known are AK80-9, "
        "AK10-9, AK60-6, AK70-10, AK80-6, AK80-64, DM3507, DM4310, DM4310_48V, DM4310P, DM4340, DM4340_48V, DM6006, "
        "DM6248P, DM8006, DM8009, DM10010L, DM10010, DM10422P, DMH3510, DMH6215, DMG6220, DMJH11, DM-J4310-2EC, "
        "DM-J4340P-2EC, DM-J8009P-2EC, none; "
        "for another model write none and the five ranges of its manual (position_range, velocity_range, "
        "torque_range, kp_range, "
        "kd_range)"},
    Refusal{
        "another motor than its nearest name", "AK10-9", "AK80-8",
        "19:53: joints[0].drive.model: drive model `AK80-8` is not known: known are AK80-9, "
        "AK10-9, AK60-6, AK70-10, AK80-6, AK80-64, DM3507, DM4310, DM4310_48V, DM4310P, DM4340, DM4340_48V, DM6006, "
        "DM6248P, DM8006, DM8009, DM10010L, DM10010, DM10422P, DMH3510, DMH6215, DMG6220, DMJH11, DM-J4310-2EC, "
        "DM-J4340P-2EC, DM-J8009P-2EC, none; "
        "for another model write none and the five ranges of its manual (position_range, velocity_range, "
        "torque_range, kp_range, "
        "kd_range)"},
    Refusal{
        "a drive that may forget where it is", "reply_id: 0, position_after_power_up: absolute }", "reply_id: 0 }",
        "19:12: key `position_after_power_up` is missing in `joints[0].drive`; add it: all but moteus: what a "
        "reading is after power-on: absolute, within_a_turn, one_of_several, unknown (docs/drives.md); in doubt, "
        "`takt joint home` comes before arming; mit (damiao, robstride), robstride: within_a_turn; others: required"},
    Refusal{"an unknown protocol", "protocol: mit, variant: tmotor, model", "protocol: mut, variant: tmotor, model",
            "19:24: joints[0].drive.protocol: protocol `mut` is not known; did you mean `mit`?"},
    Refusal{"a protocol that is not spoken", "protocol: mit, variant: tmotor, model",
            "protocol: dynamixel, baud: 57600, model",
            "19:24: joints[0].drive.protocol: protocol `dynamixel` is not known; write one of: mit, robstride, odrive, "
            "moteus, cia402"},
    Refusal{"a drive of the other variant", "AK10-9", "DM6006",
            "19:38: joints[0].drive.variant: DM6006 is no tmotor drive: correct variant or model"},
    Refusal{"a RobStride with a number that is a mode",
            "drive: { protocol: mit, variant: tmotor, model: AK10-9, id: 1, reply_id: 0, position_after_power_up: "
            "absolute }",
            "drive: { protocol: mit, variant: robstride, id: 0x80, reply_id: 0xFD, position_range: 12.57 rad, "
            "velocity_range: 33 rad/s, torque_range: 14 Nm, kp_range: 500 Nm/rad, kd_range: 5 Nms/rad }",
            "19:53: joints[0].drive.id: is at most 0x7f of a RobStride, which takes higher bits for a mode"},
    Refusal{"an unknown joint in an order", "[knee, hip]", "[knee, hips]",
            "51:23: policy.joint_order: joint `hips` is not known; did you mean `hip`?"},
    Refusal{"a joint named twice in an order", "[knee, hip]", "[knee, knee]",
            "51:23: policy.joint_order: joint `knee` is named twice; name each once"},
    Refusal{"a link with an unknown parent", "parent: hip", "parent: ankle",
            "42:30: model.links[1].parent: earlier link `ankle` is not known; write one of: base, hip"},
    Refusal{"links in another order", "joint: hip, parent: base", "joint: knee, parent: base",
            "42:30: model.links[1].parent: earlier link `hip` is not known; write one of: base, knee"},
    Refusal{"a word outside a choice", "wake: sleep", "wake: doze",
            "3:57: control.wake: wake `doze` is not known; write one of: sleep, hybrid"},
    Refusal{"ranges missing without a model", ", kd_range: 5 Nms/rad", "",
            "34:12: key `kd_range` is missing in `joints[1].drive`; add it: mit, robstride: highest packed damping"},
    Refusal{"two joints of one name", "name: knee", "name: hip",
            "32:11: joints: `hip` is also the name in line 17; rename one\n"
            "42:16: model.links[1].joint: joint `knee` is not known; write one of: hip, hip\n"
            "51:17: policy.joint_order: joint `knee` is not known; write one of: hip, hip"},
    Refusal{"two buses of one name", "when_missing: loopback }",
            "when_missing: loopback }\n  - { name: left, interface: can1 }",
            "16:13: buses: `left` is also the name in line 15; rename one"},
    Refusal{"two buses on one interface", "when_missing: loopback }",
            "when_missing: loopback }\n  - { name: right, interface: can0 }",
            "16:31: buses[1].interface: interface `can0` already belongs to bus `left`; each bus needs its own"},
    Refusal{"two sensors of one name", "timeout: 100 ms }",
            "timeout: 100 ms }\n  - { name: target, values: 1, timeout: 1 s }",
            "46:13: sensors: `target` is also the name in line 45; rename one"},
    Refusal{"two drives with one CAN id", "id: 0x02", "id: 1",
            "34:50: joints[1].drive.id: CAN id 0x1 is already hip's on bus left; give each drive its own"},
    Refusal{"a CAN FD drive on a classic bus",
            "drive: { protocol: mit, variant: tmotor, model: AK10-9, id: 1, reply_id: 0, position_after_power_up: "
            "absolute }",
            "drive: { protocol: moteus, id: 1, torque_range: 18 Nm, servo_kp: 500 Nm/rad, servo_kd: 5 Nms/rad }",
            "18:10: joints[0].bus: moteus speaks CAN FD; write `fd: true` into bus left"},
    Refusal{"a drive that replies with another's id", "id: 0x02, reply_id: 0", "id: 0x02, reply_id: 1",
            "34:66: joints[1].drive.reply_id: CAN id 0x1 is hip's id on bus left; choose another"},
    Refusal{"replies that cannot be told apart", "id: 0x02", "id: 0x101",
            "34:67: joints[1].drive.reply_id: replies of hip and knee on bus left cannot be told apart; give each its "
            "own reply_id"},
    Refusal{"a direction in words", "direction: -1", "direction: reversed",
            "34:80: joints[1].drive.direction: `reversed` is not a number; write a whole one, -1 to 1"},
    Refusal{"a direction of zero", "direction: -1", "direction: 0",
            "34:80: joints[1].drive.direction: 0 is no direction; write 1 or -1"},
    Refusal{"a tab", "  epsilon: 0.01", "\tepsilon: 0.01", "6:1: tab character; indent and separate with spaces"},
    Refusal{"a control character", "epsilon: 0.01",
            "epsilon: 0.01\x01"
            "",
            "6:16: control character 0x01; remove it"},
    Refusal{"broken YAML", "[-1 rad, 1 rad]", "[-1 rad, 1 rad",
            "22:22: YAML cannot be read: end of sequence flow not found; is a `]` or a comma missing before it?"},
    Refusal{"broken indentation", "  epsilon: 0.01", "    epsilon: 0.01",
            "6:12: YAML cannot be read: illegal map value; is a blank missing behind a `:`, or is this line indented "
            "too far?"},
    Refusal{
        "one blank less", "  window: 1 s", " window: 1 s",
        "7:2: YAML cannot be read: end of map not found; is this line indented as those above that belong with it?"},
    Refusal{"one blank less in an item of a list", "    home: 0.2 rad", "   home: 0.2 rad",
            "38:4: YAML cannot be read: end of sequence not found; is this line indented as those above that belong "
            "with it?"},
    Refusal{"an open brace", "spin: 100 us }", "spin: 100 us",
            "4:10: YAML cannot be read: end of map flow not found; is a `}` or a comma missing before it?"},
    Refusal{"a brace too many", "timeout: 20 ms }", "timeout: 20 ms }}",
            "10:29: YAML cannot be read: illegal flow end; is a `{` or `[` missing before it?"},
    Refusal{"a star", "file: small.onnx", "file: *.onnx",
            "47:9: YAML cannot be read: the referenced anchor is not defined; put the text in quotes"},
    Refusal{"another encoding", "robot: small", "robot: k\xf6nig",
            "2:9: byte 0xf6 is no UTF-8; save the file as UTF-8"},
    Refusal{
        "a decimal comma in a quantity", "120 ms", "0,12 s",
        "5:12: freshness.max_age: 0,12 s is not a time; write a point before decimals, and nothing between thousands"},
    Refusal{"a decimal comma in a number", "epsilon: 0.01", "epsilon: 0,01",
            "6:12: freshness.epsilon: `0,01` is not a number; write a point before decimals, and nothing between "
            "thousands"},
    Refusal{"a drive model in small letters", "AK10-9", "ak10-9",
            "19:53: joints[0].drive.model: drive model `ak10-9` is not known; write `AK10-9`"},
    Refusal{"an anchor", "gains: { kp: 60", "gains: &g { kp: 60",
            "30:12: an anchor (&name) is not allowed; write the value out where it is used"},
    Refusal{"an alias", "robot: small\ncontrol: { period: 1 ms", "robot: &r small\ncontrol: { period: *r",
            "2:8: an anchor (&name) is not allowed; write the value out where it is used\n"
            "3:20: an alias (*name) is not allowed; write the value out"},
    Refusal{"a merge key", "gains: { kp: 40", "gains: { <<: {}, kp: 40",
            "36:14: a merge key (<<) is not allowed; write the values out"},
    Refusal{"a tag", "max_age: 120 ms", "max_age: !!str 120 ms",
            "5:12: the tag `tag:yaml.org,2002:str` is not allowed; remove it"},
    Refusal{"a python tag", "max_age: 120 ms", "max_age: !!python/object/apply:os.system [\"true\"]",
            "5:12: the tag `tag:yaml.org,2002:python/object/apply:os.system` is not allowed; remove it"},
    Refusal{"a second document",
            "sensors:", "---\nsensors:", "45:1: a second document begins (---); keep one per file"},
    Refusal{"nothing for a value", "max_age: 120 ms",
            "max_age:", "5:3: freshness.max_age: holds nothing; write a value such as `1 ms`"},
    Refusal{"a list for a section", "feedback: { timeout: 20 ms }", "feedback: [20 ms]",
            "10:11: feedback: holds a list; write its keys below it, indented, or {key: value}"},
    Refusal{"a section for a value", "max_age: 120 ms", "max_age: { value: 120 ms }",
            "5:12: freshness.max_age: holds a section; write a value such as `1 ms`"},
    Refusal{"a value for a section", "feedback: { timeout: 20 ms }", "feedback: 20 ms",
            "10:11: feedback: holds a single value; write its keys below it, indented, or {key: value}"},
    Refusal{"a value for a list", "buses:\n  - { name: left, interface: can0, when_missing: loopback }", "buses: 3",
            "14:8: buses: holds a single value; write a list, one `- ` per entry\n"
            "17:10: joints[0].bus: bus `left` is not known: none is declared; add it\n"
            "32:10: joints[1].bus: bus `left` is not known: none is declared; add it"},
    Refusal{
        "a name with a space", "name: hip", "name: left hip",
        "17:11: joints[0].name: `left hip` is no name; use up to 63 letters, digits, _ and -, beginning with a letter\n"
        "41:16: model.links[0].joint: joint `hip` is not known; write one of: left hip, knee\n"
        "51:23: policy.joint_order: joint `hip` is not known; write one of: left hip, knee"},
    Refusal{"a wrong schema", "takt.robot/1", "takt.robot/2",
            "1:9: schema: schema `takt.robot/2` is not known; write one of: takt.robot/1"},
    Refusal{"stop_after not above max_age", "stop_after: 600 ms", "stop_after: 120 ms",
            "9:15: freshness.stop_after: 120 ms must exceed max_age 120 ms; raise it"},
    Refusal{"a window that is no multiple", "window: 1 s", "window: 1500 us",
            "7:11: freshness.window: 1500 us is no whole number of control periods of 1 ms; choose a multiple"},
    Refusal{"a window of too many ticks", "window: 1 s", "window: 10 s",
            "7:11: freshness.window: 10 s / 1 ms = 10000 ticks; write 1 to 8192 ticks"},
    Refusal{
        "a cross-fade longer than the chunk", "offset: home }",
        "offset: home, join: { kind: cross_fade, over: 100 ms } }",
        "57:79: policy.action.join.over: 100 ms exceeds the chunk's 80 ms; lower it, or write join: { kind: replace }"},
    Refusal{"a taper longer than the chunk", "offset: home }", "offset: home, join: { kind: ensemble, taper: 90 ms } }",
            "57:78: policy.action.join.taper: 90 ms exceeds the chunk's 80 ms; lower it"},
    Refusal{"a quintic through held steps", "offset: home }",
            "offset: home, interpolation: hold, join: { kind: quintic, over: 50 ms } }",
            "57:82: policy.action.join.kind: quintic smooths a path, and held steps are none; write "
            "align, or interpolate"},
    Refusal{"a prefix that reaches past the next observation", "offset: home }",
            "offset: home, join: { kind: prefix, longest: 20 ms } }",
            "57:78: policy.action.join.longest: 20 ms must end a control period before the next "
            "observation is published, 20 ms after this one; lower it, or raise policy.period"},
    Refusal{
        "a sampler's prefix that outlasts the chunk", "offset: home }",
        "offset: home, join: { kind: prefix, longest: 35 ms } }\n  sampler: { prefix: guided }",
        "57:78: policy.action.join.longest: 35 ms and 55 ms between two answers exceed the chunk's 80 ms: it would end "
        "before the answer to the next observation is played; lower it, or raise policy.steps"},
    Refusal{
        "a prefix that nobody promises", "offset: home }", "offset: home }\n  sampler: { prefix: trained }",
        "58:22: policy.sampler.prefix: continues what the executive promises to play, and it promises nothing; write "
        "policy.action.join { kind: prefix }, or none here"},
    Refusal{"one sample to choose from", "offset: home }", "offset: home }\n  sampler: { choice: agreed, samples: 1 }",
            "58:39: policy.sampler.samples: one sample leaves no choice; write 2 or more, or choice: first"},
    Refusal{"samples that nobody looks at", "offset: home }",
            "offset: home }\n  sampler: { samples: 4, choice: first }",
            "58:34: policy.sampler.choice: takes the first of 4 samples; write coherent or agreed, or samples: 1"},
    Refusal{"a tolerance that matches every state", "offset: home }",
            "offset: home }\n  speculation: { position: 1 rad, velocity: 0.1 rad/s }",
            "58:28: policy.speculation.position: is half of joint hip's range of 2 rad or more: every assumption would "
            "match; lower it"},
    Refusal{"a tolerance that matches every velocity", "offset: home }",
            "offset: home }\n  speculation: { position: 0.1 rad, velocity: 2.5 rad/s }",
            "58:47: policy.speculation.velocity: is no less than joint hip's limit of 2 rad/s: every assumption would "
            "match; lower it"},
    Refusal{"a policy period that is no multiple", "  period: 20 ms", "  period: 20500 us",
            "48:11: policy.period: 20500 us is no whole number of control periods of 1 ms; choose a multiple"},
    Refusal{"max_age not above the policy period", "max_age: 120 ms", "max_age: 15 ms",
            "5:12: freshness.max_age: 15 ms must exceed policy.period 20 ms: commands age that much before the next; "
            "raise it"},
    Refusal{"chunks too short for the policy period", "steps: 8", "steps: 2",
            "49:16: policy.step_period: steps * step_period = 20 ms must exceed policy.period 20 ms: chunks would end "
            "before the next arrives; raise one: step_period 30 ms lets two answers fail"},
    Refusal{"bus fault window too short", "feedback: { timeout: 20 ms }",
            "feedback: { timeout: 20 ms }\nbus_faults: { window: 9 ms }",
            "11:23: bus_faults.window: 9 ms must be at least ten control periods of 1 ms; raise it"},
    Refusal{
        "more observations than are remembered", "max_age: 120 ms", "max_age: 41 s",
        "5:12: freshness.max_age: 41 s with an observation every 20 ms means remembering 2052 of them; at most 2048 "
        "are: lower it, or raise policy.period\n"
        "9:15: freshness.stop_after: 600 ms must exceed max_age 41 s; raise it"},
    Refusal{"no late period at all", "spin: 100 us", "spin: 100 us, late_share: 0",
            "3:90: control.late_share: 0 is out of range; write above 0 and at most 1"},
    Refusal{"a share of nothing", "feedback: { timeout: 20 ms }",
            "feedback: { timeout: 20 ms }\nbus_faults: { foreign_frames: 0 }",
            "11:31: bus_faults.foreign_frames: 0 is out of range; write above 0 and at most 1"},
    Refusal{"feedback timeout too short", "feedback: { timeout: 20 ms }", "feedback: { timeout: 1 ms }",
            "10:22: feedback.timeout: 1 ms must be at least two control periods of 1 ms; raise it"},
    Refusal{"enable_timeout too short", "timeout: 20 ms }", "timeout: 20 ms, enable_timeout: 10 ms }",
            "10:45: feedback.enable_timeout: 10 ms must exceed feedback.timeout 20 ms; raise it"},
    Refusal{"spin as long as the period", "wake: sleep, spin: 100 us", "wake: hybrid, spin: 1 ms",
            "3:71: control.spin: 1 ms is not shorter than control.period 1 ms; the loop would never sleep"},
    Refusal{"fallback behaviour without a name", "behaviour: fallback, fallback: tuck", "behaviour: fallback",
            "11:11: degraded.fallback: none, but behaviour is `fallback`; name an entry of `fallbacks`"},
    Refusal{"velocity_hard below velocity", "velocity_hard: 4 rad/s", "velocity_hard: 1 rad/s",
            "24:22: joints[0].limits.velocity_hard: 1 rad/s is below velocity 2 rad/s; raise it"},
    Refusal{"a range that the drive cannot express", "position: [-1 rad, 1 rad]", "position: [-13 rad, 1 rad]",
            "21:17: joints[0].limits.position: (|position| + margin - offset) * gear_ratio = 13.1 rad exceeds the "
            "drive's range 12.5 rad; narrow the limit or check the model"},
    Refusal{"torque beyond the drive", "torque: 12 Nm", "torque: 66 Nm",
            "26:15: joints[0].limits.torque: torque / gear_ratio = 66 Nm exceeds the drive's range 65 Nm; narrow the "
            "limit or check the model"},
    Refusal{"kp limit beyond the drive", "kp: 100 Nm/rad", "kp: 501 Nm/rad",
            "28:11: joints[0].limits.kp: kp / gear_ratio^2 = 501 Nm/rad exceeds the drive's range 500 Nm/rad; narrow "
            "the limit or check the model"},
    Refusal{"gains above their limit", "gains: { kp: 60", "gains: { kp: 101",
            "30:18: joints[0].gains.kp: 101 exceeds limits.kp 100 Nm/rad; lower it or raise the limit"},
    Refusal{"braking distance longer than the range", "acceleration: 10 rad/s2", "acceleration: 0.5 rad/s2",
            "25:21: joints[0].limits.acceleration: velocity^2 / (2 * acceleration) = 4 rad of braking exceeds the "
            "range of 2 rad; raise it or lower velocity"},
    Refusal{"a home outside the limits", "home: 0.2 rad", "home: 2 rad",
            "38:11: joints[1].home: 2 rad is outside limits.position [-1.571, 1.571] rad; move it inside"},
    Refusal{"an axis without direction", "axis: [0, 2, 0]", "axis: [0, 0, 0]",
            "41:78: model.links[0].axis: has no direction; write a vector such as [0, 0, 1]"},
    Refusal{"an impossible inertia", "inertia: [0.01 kgm2, 0.01 kgm2, 0.002 kgm2]",
            "inertia: [0.01 kgm2, 0.01 kgm2, 0.03 kgm2]",
            "41:134: model.links[0].inertia: one moment exceeds the sum of the other two, which no body has; check the "
            "numbers"},
    Refusal{"a simulation step that does not divide", "step: 500 us", "step: 300 us",
            "59:9: simulation.step: control.period 1 ms is no whole number of steps of 300 us; choose a divisor"},
    Refusal{"a camera whose sensor has another width", "values: 3", "values: 2",
            "54:46: policy.observation[1].scale: has 3 values for a term of 2; write one, or 2\n"
            "60:21: simulation.camera.sensor: the camera gives a position of 3 values; sensor `target` has another "
            "number; declare 3"},
    Refusal{"histories that differ in by_time", "joint_order: [knee, hip]",
            "joint_order: [knee, hip]\n  history_layout: by_time",
            "55:7: policy.observation[1].history: 1 differs from the first term's 2; by_time needs equal histories\n"
            "56:7: policy.observation[2].history: 1 differs from the first term's 2; by_time needs equal histories\n"
            "57:7: policy.observation[3].history: 1 differs from the first term's 2; by_time needs equal histories"},
    Refusal{
        "a network interface that would rewrite the DDS configuration",
        "sensors:", "dds: { interface: 'lo\"/>', peers: [{ address: '${HOME}' }] }\nsensors:",
        "44:19: dds.interface: has a character that no interface has; write letters, digits, `.`, `:`, `_` and `-`\n"
        "44:47: dds.peers[0].address: has a character that no host has; write letters, digits, `.`, `:`, `_` and "
        "`-`"},
    Refusal{"a DDS domain nobody can join", "sensors:", "dds: { domain: 233, interface: eth0 }\nsensors:",
            "44:16: dds.domain: 233 is out of range; write 0 to 232"},
    Refusal{"an interface without a way to find anybody", "sensors:", "dds: { interface: eth0 }\nsensors:",
            "44:19: dds.interface: no participant can be found on it; add `peers`, or `multicast: true`"},
    Refusal{"a sensor from ROS without a domain", "timeout: 100 ms }",
            "timeout: 100 ms, ros: { topic: /wish, type: geometry_msgs/msg/Twist } }",
            "45:54: sensors[0].ros: is read in the domain of `dds`; add that section (`dds: {}`)"},
    Refusal{"a topic without its slash", "timeout: 100 ms }",
            "timeout: 100 ms, ros: { topic: wish, type: geometry_msgs/msg/Twist } }\ndds: {}",
            "45:63: sensors[0].ros.topic: is no topic; write it as ros2 topic list shows it: /imu/data"},
    Refusal{"an Imu for three values", "timeout: 100 ms }",
            "timeout: 100 ms, ros: { topic: /imu, type: sensor_msgs/msg/Imu } }\ndds: {}",
            "45:75: sensors[0].ros.type: an Imu gives 10 values; write `values: 10`"},
    Refusal{"an Image for three values", "timeout: 100 ms }",
            "timeout: 100 ms, ros: { topic: /cam, type: sensor_msgs/msg/Image, encoding: rgb8 } }\ndds: {}",
            "45:75: sensors[0].ros.type: an Image is no list of values; write `image`"},
    Refusal{"a JointState with another number of joints", "timeout: 100 ms }",
            "timeout: 100 ms, ros: { topic: /j, type: sensor_msgs/msg/JointState, joints: [{ name: a }] } }\ndds: {}",
            "45:73: sensors[0].ros.type: a JointState of 1 joints gives 1 values; write `values: 1`"},
    Refusal{"an Image of another depth", "timeout: 100 ms }",
            "timeout: 100 ms }\n  - { name: cam, image: { height: 2, width: 2, channels: 1 }, timeout: 100 ms, ros: { "
            "topic: /cam, type: sensor_msgs/msg/Image, encoding: rgb8 } }\ndds: {}",
            "46:106: sensors[1].ros.type: its encoding has 3 channels, `image` 1; make them equal"},
    Refusal{"a queue longer than its mailbox allows", "timeout: 100 ms }", "timeout: 100 ms, queue: 129 }",
            "45:56: sensors[0].queue: 129 is out of range; write 0 to 128"},
};

}  // namespace takt::config::test
