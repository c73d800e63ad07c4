// SPDX-License-Identifier: Apache-2.0
/* What Takt and a world, a process of the user's that plays mechanics and sensors, say to one another in lock step.
 * docs/world-protocol.md is the protocol on one page; takt/world.h the world's side of it in C.
 *
 * Little-endian, as laid out here, without padding but the reserved fields, which are zero. Arrays have room for
 * TAKT_WORLD_MAX_JOINTS; the first hello.joint_count are used, in the robot file's order. Joint side: rad, rad/s, Nm.
 */
#ifndef TAKT_WORLD_MESSAGES_H
#define TAKT_WORLD_MESSAGES_H

#include <stdint.h>

#define TAKT_WORLD_PROTOCOL 3
#define TAKT_WORLD_MAX_JOINTS 64
#define TAKT_WORLD_NAME_BYTES 64
#define TAKT_WORLD_TEXT_BYTES 128
#define TAKT_WORLD_MAX_VALUES 64
#define TAKT_WORLD_MAX_CAMERAS 8

/* Where the messages lie in the shared memory: Takt's from the beginning, the world's from here, and what it says of
 * the images that come with its state (takt_world_image), one behind the other. Behind all that lie the images
 * themselves, each camera's at its `offset`. */
#define TAKT_WORLD_ANSWER_OFFSET 8192
#define TAKT_WORLD_IMAGES_OFFSET 12288
#define TAKT_WORLD_MEMORY_BYTES 16384 /* without images; hello says the whole length */

/* Kinds of message. */
enum {
  TAKT_WORLD_HELLO = 1,   /* Takt: the robot; first, by the socket */
  TAKT_WORLD_WELCOME = 2, /* world: answers hello, by the socket */
  TAKT_WORLD_RESET = 3,   /* Takt: begin anew */
  TAKT_WORLD_STEP = 4,    /* Takt: move on under these torques */
  TAKT_WORLD_STATE = 5    /* world: answers reset and step */
};

/* What a welcome may say of its world (bits). */
enum {
  TAKT_WORLD_SHARED_MEMORY = 1, /* further messages go through the memory that came with hello, not by the socket */
  TAKT_WORLD_IMU = 2,           /* states have an IMU's readings */
  TAKT_WORLD_POINT = 4,         /* states have the controlled point */
  TAKT_WORLD_BASE = 8,          /* states have the pose of the robot's base */
  TAKT_WORLD_ERROR = 16,        /* states have the task's error: the world judges how well it goes */
  TAKT_WORLD_DONE = 32,         /* it says when the task is done: a rollout that ends before has failed */
  TAKT_WORLD_PUSH = 64          /* it pushes the robot's base, or an arm's tool, as steps say */
};

/* How a rollout stands. */
enum {
  TAKT_WORLD_RUNNING = 0,
  TAKT_WORLD_SUCCEEDED = 1, /* the task is done */
  TAKT_WORLD_FAILED = 2,    /* the task is beyond help: something fell */
  TAKT_WORLD_UNABLE = 3     /* the world cannot go on: its physics diverged */
};

typedef struct takt_world_header {
  uint32_t bytes; /* of the whole message */
  uint16_t kind;
  uint16_t protocol; /* TAKT_WORLD_PROTOCOL */
  uint64_t sequence; /* of Takt's messages, from 1, by one; an answer repeats that of its question */
} takt_world_header;

/* A sensor of images, as the robot file declares it: bytes, row after row, the channels of a pixel together. */
typedef struct takt_world_camera {
  char name[TAKT_WORLD_NAME_BYTES];
  uint32_t height, width, channels;
  uint32_t offset; /* of its image in the shared memory, as hello says */
} takt_world_camera;

typedef struct takt_world_hello {
  takt_world_header header;
  uint64_t step_ns; /* of every step */
  uint32_t joint_count;
  uint32_t camera_count;
  uint64_t memory_bytes;             /* length of the shared memory */
  char robot[TAKT_WORLD_NAME_BYTES]; /* names end with a zero byte */
  char joints[TAKT_WORLD_MAX_JOINTS][TAKT_WORLD_NAME_BYTES];
  takt_world_camera cameras[TAKT_WORLD_MAX_CAMERAS]; /* the robot file's sensors of images, in its order */
} takt_world_hello;

typedef struct takt_world_welcome {
  takt_world_header header;
  uint32_t gives;        /* bits above */
  uint32_t sensor_count; /* values of the sensor below */
  char world[TAKT_WORLD_NAME_BYTES];
  char sensor[TAKT_WORLD_NAME_BYTES];  /* of the robot file's outside sensors, the one that states have; empty: none */
  char refusal[TAKT_WORLD_TEXT_BYTES]; /* empty: welcome; else why this robot is not played, one sentence */
  uint32_t camera_count;
  uint32_t reserved;
  takt_world_camera cameras[TAKT_WORLD_MAX_CAMERAS]; /* whose images states have; offset: 0 */
} takt_world_welcome;

typedef struct takt_world_reset {
  takt_world_header header;
  uint64_t seed; /* of everything that the world draws */
  double
      q[TAKT_WORLD_MAX_JOINTS]; /* rad, where the robot file wants its joints to begin; the state says where they do */
} takt_world_reset;

typedef struct takt_world_step {
  takt_world_header header;
  uint64_t time_ns;                      /* since the reset, at the step's beginning */
  uint64_t step_ns;                      /* as in hello */
  double torque[TAKT_WORLD_MAX_JOINTS];  /* Nm, of the drives, constant over the step */
  double viscous[TAKT_WORLD_MAX_JOINTS]; /* Nm s/rad, friction of drive and brake beside the world's own */
  double coulomb[TAKT_WORLD_MAX_JOINTS]; /* Nm; holds a joint at rest: an engaged brake is in here */
  uint32_t hangs;                        /* 1: a base that would fall hangs where it began */
  uint32_t reserved;
  double push[3]; /* N, world frame, at the base, or at an arm's tool; of worlds that push */
} takt_world_step;

typedef struct takt_world_state {
  takt_world_header header;
  uint64_t time_ns;     /* since the reset, at the step's end */
  uint32_t outcome;     /* how the rollout stands */
  uint32_t image_count; /* new images that come with it, at most one of each camera */
  double q[TAKT_WORLD_MAX_JOINTS];
  double dq[TAKT_WORLD_MAX_JOINTS];
  double point[3];                      /* m, world frame: what the task wants at its target */
  double orientation[4];                /* w x y z, of the IMU in the world, length 1 */
  double angular_velocity[3];           /* rad/s, in the IMU's axes */
  double acceleration[3];               /* m/s2, specific force in the IMU's axes: 9.81 upwards at rest */
  double base_position[3];              /* m, world frame, z up */
  double base_orientation[4];           /* w x y z, of the base in the world, length 1 */
  double error;                         /* m or what the task is measured in, 0 or more: how far from what it wants */
  uint64_t sensor_sequence;             /* of the newest sample, from 1, by one; 0: none yet */
  double sensor[TAKT_WORLD_MAX_VALUES]; /* its values; it was taken at this state's time */
  char reason[TAKT_WORLD_TEXT_BYTES];   /* of an outcome that is not running, one sentence, or empty */
} takt_world_state;

/* One image that comes with a state: in the shared memory at TAKT_WORLD_IMAGES_OFFSET, its bytes at its camera's
 * offset; by the socket behind the state, and its bytes behind it. */
typedef struct takt_world_image {
  uint32_t camera;   /* its place in hello.cameras */
  uint32_t bytes;    /* height * width * channels */
  uint64_t sequence; /* of this camera's images since the reset, from 1, by one */
  uint64_t time_ns;  /* since the reset: when it was sensed; later than the image before, not after the state's time */
} takt_world_image;

#endif
