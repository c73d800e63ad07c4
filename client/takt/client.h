// SPDX-License-Identifier: Apache-2.0
/* Takt for a process of your own, in C: be a robot's policy, or one of its sensors.
 *
 * A policy reads observations of a running executive and answers them with chunks of joint targets. Age stays the
 * executive's affair: the oldest sample of everything that was read counts, and the library says so in every command.
 *
 *   takt_policy_open -> takt_policy_attach -> { takt_policy_next -> [infer_begin, infer_end] -> takt_policy_publish }*
 *   -> takt_policy_detach -> takt_policy_close
 *
 * A sensor of the robot file (its `sensors`: float32 values, or images of 8 bits) publishes samples into shared memory,
 * written in place, each stamped with the instant at which it was sensed. Who reads it does not matter here:
 * policies, the executive, none or several.
 *
 *   takt_sensor_open -> { takt_sensor_values, fill -> takt_sensor_publish }* -> takt_sensor_close
 *
 * Shapes, units: joints are those of the robot file in its order; q rad, dq rad/s, tau Nm, kp Nm/rad, kd Nms/rad;
 * float32; stamps in ns of CLOCK_MONOTONIC.
 *
 * Errors: a return code below, and one line of text: what is wrong, how to correct it. No function ends the process,
 * prints or throws.
 *
 * Thread rule: a policy or a sensor belongs to the thread that opened it. Several are independent of one another.
 *
 * Versions: what this header promises is TAKT_CLIENT_ABI; fields and functions are only ever added to it, at the end.
 * Library and executive must come from the same version of Takt; the executive refuses others.
 */
#ifndef TAKT_CLIENT_H
#define TAKT_CLIENT_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define TAKT_CLIENT_ABI 1

/* The ABI that the library has; compare with TAKT_CLIENT_ABI where it may be another than the one compiled with. */
uint32_t takt_client_abi(void);

/* Return codes. Those that end a program are also its exit code (docs/exit-codes.md). */
enum {
  TAKT_OK = 0,
  TAKT_NOTHING = 1,     /* not yet: no executive, no new observation, or no usable sample of a stream; go on waiting */
  TAKT_USAGE = 64,      /* called in a wrong order or with an argument that cannot be */
  TAKT_BAD_CONFIG = 65, /* the robot file, or what was asked of it, is refused */
  TAKT_REFUSED = 69,    /* the executive answered, and wants another policy, robot file or version, or has a policy */
  TAKT_BUG = 70         /* a fault of the library's own; the policy is only good for takt_policy_close */
};

/* What a term of the observation is. */
enum {
  TAKT_TERM_Q = 0,          /* joint_count values: estimated positions, rad */
  TAKT_TERM_DQ = 1,         /* joint_count values: estimated velocities, rad/s */
  TAKT_TERM_TAU = 2,        /* joint_count values: measured torques, Nm */
  TAKT_TERM_Q_SETPOINT = 3, /* joint_count values: what the drives were last told, rad */
  TAKT_TERM_STREAM = 4,     /* newest sample of an outside sensor of the robot file, in its own units */
  TAKT_TERM_IMAGE = 5,      /* newest image of an outside sensor; in takt_observation.images, not in its values */
  TAKT_TERM_QUEUE = 6,      /* the samples since the last observation, of a sensor of the robot file with `queue`; in
                               takt_observation.queues, not in its values */
  TAKT_TERM_DQ_OF_DRIVE = 7 /* joint_count values: velocities as the drives report them, rad/s */
};

/* A sensor as the robot file describes it; constant. */
enum { TAKT_FLOAT32 = 0, TAKT_UINT8 = 1 };
typedef struct takt_stream {
  const char* name;
  const char* unit;                 /* "unstated": the robot file does not say */
  int64_t timeout_ns;               /* a sample that is older is not used */
  uint32_t type;                    /* TAKT_FLOAT32, TAKT_UINT8 */
  uint32_t values;                  /* of a sample: floats, or the bytes of an image */
  uint32_t height, width, channels; /* TAKT_UINT8: row after row, the channels of a pixel together; else 0 */
  uint32_t reserved;
} takt_stream;

typedef struct takt_term {
  uint32_t kind;
  uint32_t values;     /* STREAM, QUEUE: how many per sample the policy expects; IMAGE: how many bytes; else 0 */
  const char* stream;  /* STREAM, QUEUE, IMAGE: name of an entry in the robot file's `sensors`; else NULL, as below */
  const char* unit;    /* that sensor's `unit`, as there; NULL: not compared */
  const char* max_age; /* its `timeout`, as in a robot file: "80 ms"; NULL: not compared */
} takt_term;

/* What the policy is. Copied; nothing has to outlive takt_policy_open. */
typedef struct takt_policy_spec {
  uint32_t size;                 /* sizeof(takt_policy_spec) */
  uint32_t term_count;           /* 1 or more */
  const takt_term* terms;        /* laid out in takt_observation.values in this order */
  const char* robot_file;        /* path */
  const char* runtime_directory; /* where the robot's sockets are; NULL: the default for this user and robot */
  const char* program;           /* how others call this process, at most 39 characters */
  const char* step;              /* time between two steps of a chunk, as in a robot file: "10 ms" */
  uint32_t steps;                /* steps of a chunk, 1 to 128 */
  uint32_t reserved;             /* 0 */
  /* NULL: be the robot's policy. Else a candidate that runs beside it (`takt policy swap`): path of the program or of
   * the file with what it has learned, whose SHA-256 is its identity. */
  const char* candidate_file;
  /* How the chunks are made to follow one another: the robot file's policy.action.join.kind ("cross_fade", "prefix",
   * ...), or "rtc", which is prefix: each answer goes on from takt_observation.committed. NULL: not compared. */
  const char* join;
} takt_policy_spec;

/* The robot as its file describes it; constant. */
typedef struct takt_robot {
  const char* name;
  const char* policy_file; /* absolute path; its SHA-256 is the policy's identity */
  uint64_t policy_hash;    /* first 8 bytes of that, big-endian */
  uint32_t joint_count;
  uint32_t steps;
  const char* const* joints; /* joint_count names */
  const float* home;         /* joint_count positions, rad */
  int64_t period_ns;         /* between two observations */
  int64_t step_ns;           /* between two steps of a chunk */
} takt_robot;

/* What came from one sensor since the observation before, oldest first: the newest `count` of what could be used. Its
 * age is that of the newest, as with every history; count 0: nothing new, and the sample before still is the newest. */
typedef struct takt_queue {
  const float* values;      /* count x value_count, sample after sample */
  const int64_t* sensed_ns; /* count; when each was sensed */
  uint32_t count;           /* at most `capacity` */
  uint32_t capacity;        /* sensors[].queue of the robot file */
  uint32_t value_count;     /* of one sample */
  uint32_t reserved;
  uint64_t dropped; /* samples since the observation before that are not here: too many, overwritten, or no numbers */
} takt_queue;

/* The observation that takt_policy_next returned last; contents change with the next call, addresses never. */
typedef struct takt_observation {
  uint64_t id;               /* 1, 2, 3, ... within a session; 0: none yet */
  uint64_t dropped;          /* observations published since the one before this that were never returned */
  int64_t published_ns;      /* when the executive published it; step 0 of a chunk is meant for then */
  int64_t sensed_ns;         /* receive stamp of the oldest joint sample inside */
  int64_t outside_sensed_ns; /* when the oldest of the streams' samples was sensed; 0: no streams */
  const float* values;       /* the terms one after the other */
  const char* mode;          /* of the executive: "standby", "arming", "tracking", "degraded", "damped_stop", ... */
  uint32_t value_count;
  uint32_t reset; /* 1: forget what you remember: new session, long gap, arming, own output was not finite */
  const uint8_t* const* images; /* image_count, in the terms' order */
  uint32_t image_count;
  uint32_t reserved;
  /* The robot follows the chunk of this session's publish number `following` (1, 2, ...; 0: none), and will play
   * committed_count of its steps, from committed_from on, whatever answers this observation. 0: nothing is promised,
   * unless the robot file's policy.action.join is `prefix`. */
  uint64_t following;
  uint32_t committed_from;
  uint32_t committed_count;
  const takt_queue* queues; /* queue_count, in the terms' order */
  uint32_t queue_count;
  uint32_t reserved_too;
  /* What a network that goes on from it is given: committed_count x joint_count positions, rad, oldest first. Row i is
   * for step i of the answer: where the promised chunk leads the robot at published_ns + i * step_ns, read between its
   * steps as policy.action.interpolation says (hold: the step that is played for most of the row's time), as published,
   * before clamps. The first row is the present; the last may reach up to a step past the promise, along the same path.
   * An answer that came too late for this observation to know of it is taken at once: then it is its path.
   * NULL: nothing is promised, or more than 32 answers were published since that chunk. */
  const float* committed;
} takt_observation;

/* What a speculative chunk assumes: where the joints are, joint_count values each, at an instant after the observation
 * that it answers. Its step 0 is meant for that instant. It waits in this library, up to 8 of them: the first
 * observation published at or after the instant is compared, and answered by the nearest one that matches within the
 * robot file's policy.speculation, or by none. That answer's age counts from the samples that the chunk rests on. */
typedef struct takt_assumption {
  uint32_t size;     /* sizeof(takt_assumption) */
  uint32_t reserved; /* 0 */
  int64_t at_ns;     /* the instant: published_ns of the observation, and so many periods later */
  const float* q;    /* rad; not NULL */
  const float* dq;   /* rad/s, or NULL: any velocity will do */
} takt_assumption;

/* A chunk: steps x joint_count values each, step after step. Between steps the executive does what the robot file's
 * policy.action.interpolation declares. Without kp and kd the joint's gains hold, without tau_ff it is 0. */
typedef struct takt_chunk {
  uint32_t size;                  /* sizeof(takt_chunk) */
  uint32_t reserved;              /* 0 */
  const float* q;                 /* rad; not NULL */
  const float* dq;                /* rad/s, or NULL; hold: either, linear: NULL, cubic: not NULL */
  const float* kp;                /* Nm/rad, or NULL */
  const float* kd;                /* Nms/rad, or NULL */
  const float* tau_ff;            /* Nm, or NULL */
  const takt_assumption* assumes; /* NULL: it is meant for the observation that it answers */
} takt_chunk;

/* What became of the chunks with an assumption, since takt_policy_open. Those that are in none of the last four wait.
 */
typedef struct takt_alternatives {
  uint64_t kept;
  uint64_t taken;     /* matched, were the nearest, and were published */
  uint64_t outdone;   /* matched too, and another was nearer */
  uint64_t unmatched; /* the state was another */
  uint64_t dropped;   /* never compared: too old, too many, their observation was missed, or what was remembered went */
} takt_alternatives;

typedef struct takt_policy takt_policy;

/* Reads the robot file and compares it with the spec; sends nothing. On success *policy is to be closed; otherwise it
 * is NULL and `why` (why_bytes of room, zero-terminated, cut off where it does not fit) has the sentence. Also sets the
 * calling thread's niceness to the robot file's policy.nice, where that is granted. Returns OK, USAGE, BAD_CONFIG, BUG.
 */
int takt_policy_open(const takt_policy_spec* spec, takt_policy** policy, char* why, uint32_t why_bytes);

/* Takes the executive's one policy lease, waiting at most about `timeout_ns` for an executive. Returns OK, also
 * when attached already, NOTHING, REFUSED, BUG. */
int takt_policy_attach(takt_policy* policy, int64_t timeout_ns);

/* Waits at most about `timeout_ns` for the newest observation that was not returned before; one that was overtaken is
 * dropped and counted. Attaches again when the executive went away. An observation for which a stream has no usable
 * sample (none yet, or older than the sensor's timeout) is not returned: takt_policy_sentence says which. A signal does
 * not end the wait. Returns OK, NOTHING, REFUSED, BUG. */
int takt_policy_next(takt_policy* policy, int64_t timeout_ns);

/* Optional stamps around the inference, once each per observation. Without them all from takt_policy_next to
 * takt_policy_publish is called inference. Returns OK, USAGE. */
int takt_policy_infer_begin(takt_policy* policy);
int takt_policy_infer_end(takt_policy* policy);

/* Answers the observation returned last; the values are copied before it returns. Values travel as they are: the
 * executive refuses a chunk that is not finite, and clamps and counts what is out of a joint's range. Never waits. May
 * be called several times for one observation: only the newest counts, and of chunks with an assumption each waits for
 * its instant. What the robot is sent has the earlier answers mixed in where the robot file's policy.action.join is
 * blend, ensemble, align or quintic. Returns OK, USAGE (also for dq where the robot file's interpolation has none, or
 * lacks one, and for an assumption where it has no policy.speculation), BUG.
 * Behind the chunk the recorder is told what the observation showed, images by name, unless the robot file says
 * record.policy_inputs: false (docs/policies.md). */
int takt_policy_publish(takt_policy* policy, const takt_chunk* chunk);

/* For people and for the record: in takt status, in the executive's log and in the run folder, as what the policy says.
 * Printable ASCII; what is beyond 199 characters is cut off. NULL is as "". May be called before the policy is
 * attached; a session that begins is told again. Returns OK. problem: why it publishes nothing; "", or a publish, ends
 * that. source: which other process made the chunk that is published next and those behind it; "": the policy itself
 * did. */
int takt_policy_state_problem(takt_policy* policy, const char* problem);
int takt_policy_state_source(takt_policy* policy, const char* source);

/* Valid until takt_policy_close; never NULL. */
const takt_robot* takt_policy_robot(const takt_policy* policy);
const takt_observation* takt_policy_observation(const takt_policy* policy);
const takt_alternatives* takt_policy_alternatives(const takt_policy* policy);
/* The sensor of this name; NULL: the robot file lists none. */
const takt_stream* takt_policy_stream(const takt_policy* policy, const char* name);
/* Why the last call did not return OK; empty where there is nothing to say. Valid until the next call. */
const char* takt_policy_sentence(const takt_policy* policy);

/* Gives the lease back; the robot then has no policy, and what was observed last may still be read. */
void takt_policy_detach(takt_policy* policy);

/* Detaches and frees. NULL is fine. */
void takt_policy_close(takt_policy* policy);

/* What the sensor gives. Copied. */
typedef struct takt_sensor_spec {
  uint32_t size;                    /* sizeof(takt_sensor_spec) */
  uint32_t type;                    /* TAKT_FLOAT32, TAKT_UINT8 */
  const char* robot_file;           /* path */
  const char* runtime_directory;    /* where the robot's sockets are; NULL: the default for this user and robot */
  const char* name;                 /* of an entry in the robot file's `sensors` */
  const char* unit;                 /* as there; NULL: not compared */
  const char* policy_user;          /* one more user who may read it, besides this one and root; NULL: none */
  uint32_t values;                  /* TAKT_FLOAT32: of a sample; else 0 */
  uint32_t height, width, channels; /* TAKT_UINT8; else 0 */
} takt_sensor_spec;

typedef struct takt_sensor takt_sensor;

/* Compares the spec with the robot file and serves sensor-NAME.sock in the runtime directory. Errors as
 * takt_policy_open's, and REFUSED: another process serves this sensor already. Starts one thread, which greets readers
 * and takes no signals. */
int takt_sensor_open(const takt_sensor_spec* spec, takt_sensor** sensor, char* why, uint32_t why_bytes);

/* The memory of the next sample: `values` floats or bytes, shared with the readers, who see none of it before it is
 * published. What is in it is an earlier sample. Another address after every takt_sensor_publish; write no more to the
 * old one. */
void* takt_sensor_values(takt_sensor* sensor);

/* Publishes what is in there. `sensed_ns`: when it was sensed (a camera's shutter), ns of CLOCK_MONOTONIC; it counts in
 * the age of every command that rests on it. Never waits. Returns OK, USAGE (also for a stamp that is after now), BUG.
 */
int takt_sensor_publish(takt_sensor* sensor, int64_t sensed_ns);

/* Valid until takt_sensor_close; never NULL. */
const takt_stream* takt_sensor_stream(const takt_sensor* sensor);
/* Why the last call did not return OK; empty where there is nothing to say. Valid until the next call. */
const char* takt_sensor_sentence(const takt_sensor* sensor);

/* Readers see that it is gone, and keep the last sample for as long as its timeout lets them. NULL is fine. */
void takt_sensor_close(takt_sensor* sensor);

#ifdef __cplusplus
}
#endif

#endif
