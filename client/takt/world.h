// SPDX-License-Identifier: Apache-2.0
/* A world for Takt in C: a process that plays a robot's mechanics, over shared memory. Nothing to link; needs Linux.
 *
 *   takt_world world;
 *   if (takt_world_listen(&world, "/tmp/world.sock") != 0) return 1;
 *   while (takt_world_accept(&world, "mine", TAKT_WORLD_POINT) == 0) {      one simulation of Takt's after the other
 *     takt_world_state state = {0};
 *     while (takt_world_next(&world) == 0) {
 *       if (world.kind == TAKT_WORLD_RESET) begin(&world.reset, &state); else move(&world.step, &state);
 *       takt_world_answer(&world, &state);
 *     }
 *   }
 *
 * One that sees for the robot: takt_world_add_camera before accept, then draw into takt_world_pixels and say so by
 * takt_world_show before the answer.
 *
 * Errors: -1 with errno. takt_world_next says -1 when Takt has gone, which ends that simulation and is no fault.
 * Thread rule: a world belongs to one thread. Messages and units: takt/world_messages.h, docs/world-protocol.md.
 */
#ifndef TAKT_WORLD_H
#define TAKT_WORLD_H

#include <errno.h>
#include <stddef.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "world_messages.h"

typedef struct takt_world {
  int listener, peer;
  int memory;
  unsigned char* shared; /* hello.memory_bytes */
  const char*
      sensor; /* to be set after takt_world_listen: the robot file's outside sensor that states have; NULL: none */
  uint32_t sensor_count; /* its values */
  takt_world_camera cameras[TAKT_WORLD_MAX_CAMERAS];
  uint32_t camera_count;
  int places[TAKT_WORLD_MAX_CAMERAS];               /* in hello.cameras, of each of those; -1: not there */
  uint64_t images_shown[TAKT_WORLD_MAX_CAMERAS];    /* since the reset */
  takt_world_image to_show[TAKT_WORLD_MAX_CAMERAS]; /* with the next answer */
  uint32_t to_show_count;
  takt_world_hello hello;
  uint16_t kind; /* of the latest message: reset or step */
  union {
    takt_world_header header;
    takt_world_reset reset;
    takt_world_step step;
  };
} takt_world;

/* A socket that an earlier world left behind at `path` is replaced. */
static inline int takt_world_listen(takt_world* world, const char* path) {
  struct sockaddr_un address;
  memset(world, 0, sizeof *world);
  memset(&address, 0, sizeof address);
  world->listener = world->peer = world->memory = -1;
  if (strlen(path) >= sizeof address.sun_path) {
    errno = ENAMETOOLONG;
    return -1;
  }
  address.sun_family = AF_UNIX;
  strcpy(address.sun_path, path);
  world->listener = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (world->listener < 0) return -1;
  unlink(path);
  if (bind(world->listener, (struct sockaddr*)&address, sizeof address) != 0) return -1;
  return listen(world->listener, 4);
}

/* After takt_world_listen: states have images of the robot file's sensor of that name. Returns which camera it is. */
static inline int takt_world_add_camera(takt_world* world, const char* name, uint32_t height, uint32_t width,
                                        uint32_t channels) {
  takt_world_camera* camera;
  if (world->camera_count == TAKT_WORLD_MAX_CAMERAS || strlen(name) >= TAKT_WORLD_NAME_BYTES) {
    errno = EINVAL;
    return -1;
  }
  camera = &world->cameras[world->camera_count];
  strcpy(camera->name, name);
  camera->height = height;
  camera->width = width;
  camera->channels = channels;
  return (int)world->camera_count++;
}

/* Ends the simulation that is under way. */
static inline void takt_world_leave(takt_world* world) {
  int* const files[2] = {&world->peer, &world->memory};
  size_t i;
  if (world->shared != NULL) munmap(world->shared, world->hello.memory_bytes);
  world->shared = NULL;
  for (i = 0; i < 2; ++i) {
    if (*files[i] >= 0) close(*files[i]);
    *files[i] = -1;
  }
}

/* Where the robot of hello has this world's cameras. */
static inline void takt_world_find_cameras(takt_world* world) {
  uint32_t i, place;
  for (i = 0; i < world->camera_count; ++i) {
    world->places[i] = -1;
    for (place = 0; place < world->hello.camera_count; ++place)
      if (strcmp(world->hello.cameras[place].name, world->cameras[i].name) == 0) world->places[i] = (int)place;
  }
}

/* Receives hello with its memory. */
static inline int takt_world_receive_hello(takt_world* world) {
  union {
    struct cmsghdr aligned;
    char bytes[CMSG_SPACE(3 * sizeof(int))];
  } control;
  struct iovec piece;
  struct msghdr message;
  struct cmsghdr* part;
  size_t got = 0;
  memset(&message, 0, sizeof message);
  while (got < sizeof world->hello) {
    ssize_t size;
    piece.iov_base = (char*)&world->hello + got;
    piece.iov_len = sizeof world->hello - got;
    message.msg_iov = &piece;
    message.msg_iovlen = 1;
    message.msg_control = control.bytes;
    message.msg_controllen = sizeof control.bytes;
    size = recvmsg(world->peer, &message, MSG_CMSG_CLOEXEC);
    if (size < 0 && errno == EINTR) continue;
    if (size <= 0) return -1;
    got += (size_t)size;
    part = CMSG_FIRSTHDR(&message);
    if (part != NULL && part->cmsg_type == SCM_RIGHTS && part->cmsg_len == CMSG_LEN(sizeof(int)))
      memcpy(&world->memory, CMSG_DATA(part), sizeof(int));
  }
  if (world->memory >= 0 && world->hello.header.kind == TAKT_WORLD_HELLO &&
      world->hello.header.protocol == TAKT_WORLD_PROTOCOL && world->hello.joint_count <= TAKT_WORLD_MAX_JOINTS &&
      world->hello.camera_count <= TAKT_WORLD_MAX_CAMERAS) {
    takt_world_find_cameras(world);
    return 0;
  }
  errno = EPROTO;
  return -1;
}

/* Tells Takt why its robot is not played, one sentence, or, with NULL, that it is. */
static inline int takt_world_welcome_takt(takt_world* world, const char* name, uint32_t gives, const char* refusal) {
  takt_world_welcome welcome;
  memset(&welcome, 0, sizeof welcome);
  welcome.header = world->hello.header;
  welcome.header.bytes = sizeof welcome;
  welcome.header.kind = TAKT_WORLD_WELCOME;
  welcome.gives = gives | TAKT_WORLD_SHARED_MEMORY;
  strncpy(welcome.world, name, sizeof welcome.world - 1);
  if (world->sensor != NULL) strncpy(welcome.sensor, world->sensor, sizeof welcome.sensor - 1);
  welcome.sensor_count = world->sensor_count;
  welcome.camera_count = world->camera_count;
  memcpy(welcome.cameras, world->cameras, sizeof welcome.cameras);
  if (refusal != NULL) strncpy(welcome.refusal, refusal, sizeof welcome.refusal - 1);
  return send(world->peer, &welcome, sizeof welcome, MSG_NOSIGNAL) == (ssize_t)sizeof welcome ? 0 : -1;
}

/* Waits for the next simulation. world->hello says which robot; to look at it before welcoming it, call these parts. */
static inline int takt_world_accept(takt_world* world, const char* name, uint32_t gives) {
  takt_world_leave(world);
  do {
    world->peer = accept(world->listener, NULL, NULL);
  } while (world->peer < 0 && errno == EINTR);
  if (world->peer < 0 || takt_world_receive_hello(world) != 0) return -1;
  void* const at = mmap(NULL, world->hello.memory_bytes, PROT_READ | PROT_WRITE, MAP_SHARED, world->memory, 0);
  if (at == MAP_FAILED) return -1;
  world->shared = (unsigned char*)at;
  return takt_world_welcome_takt(world, name, gives, NULL);
}

/* Waits for a reset or a step: world->kind, world->reset, world->step. */
static inline int takt_world_next(takt_world* world) {
  unsigned char ring;
  ssize_t size;
  do {
    size = recv(world->peer, &ring, 1, 0);
  } while (size < 0 && errno == EINTR);
  if (size <= 0) return -1; /* Takt has gone */
  memcpy(&world->step, world->shared, sizeof world->step);
  world->kind = world->header.kind;
  world->to_show_count = 0;
  if (world->kind == TAKT_WORLD_RESET) memset(world->images_shown, 0, sizeof world->images_shown);
  return 0;
}

/* Where that camera's image is drawn: height x width x channels bytes, Takt's to read from the answer to the next
 * question, the world's otherwise. NULL: this robot has no such sensor, and Takt refuses the world. */
static inline unsigned char* takt_world_pixels(takt_world* world, int camera) {
  const int place = world->places[camera];
  return place < 0 ? NULL : world->shared + world->hello.cameras[place].offset;
}

/* What was drawn there goes with the next answer, once. `time_ns`: since the reset, when it was sensed. */
static inline void takt_world_show(takt_world* world, int camera, uint64_t time_ns) {
  const takt_world_camera* const shape = &world->cameras[camera];
  takt_world_image* const image = &world->to_show[world->to_show_count];
  if (world->places[camera] < 0 || world->to_show_count == TAKT_WORLD_MAX_CAMERAS) return;
  image->camera = (uint32_t)world->places[camera];
  image->bytes = shape->height * shape->width * shape->channels;
  image->sequence = ++world->images_shown[camera];
  image->time_ns = time_ns;
  ++world->to_show_count;
}

/* `state` without its header, which is filled in here. */
static inline int takt_world_answer(takt_world* world, takt_world_state* state) {
  const unsigned char ring = 1;
  state->header = world->header;
  state->header.bytes = sizeof *state;
  state->header.kind = TAKT_WORLD_STATE;
  state->image_count = world->to_show_count;
  if (world->to_show_count != 0)
    memcpy(world->shared + TAKT_WORLD_IMAGES_OFFSET, world->to_show, world->to_show_count * sizeof *world->to_show);
  memcpy(world->shared + TAKT_WORLD_ANSWER_OFFSET, state, sizeof *state);
  return send(world->peer, &ring, 1, MSG_NOSIGNAL) == 1 ? 0 : -1;
}

#endif
