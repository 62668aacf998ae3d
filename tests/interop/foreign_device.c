/* A haptic device of another maker: C types that `idlc` made of idl/subworld.idl, and Cyclone DDS. It takes the place
   of device_sim for one user in real time. The protocol: device_sim/README.md and common/wire/README.md.

   foreign_device DOMAIN USER: presses 5 cm along +x, ends with the run, and prints what it felt. */
#include <dds/dds.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "subworld.h"

#define RATE_HZ 1000
enum { DEVICE_SIM = 2, WIRE_VERSION = 100007 };

static dds_entity_t required(dds_entity_t entity, const char* what) {
  if (entity >= 0) return entity;
  fprintf(stderr, "foreign_device: error: %s: %s\n", what, dds_strretcode(entity));
  exit(3);
}

/* The quality of service of the topic's row on the network page. */
static dds_qos_t* quality(int reliable, int depth, double deadline_s, double lease_s, const char* partition) {
  dds_qos_t* qos = dds_create_qos();
  const dds_data_representation_id_t plain_cdr = DDS_DATA_REPRESENTATION_XCDR1;
  dds_qset_data_representation(qos, 1, &plain_cdr);
  dds_qset_reliability(qos, reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT, DDS_MSECS(100));
  dds_qset_durability(qos, reliable ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  dds_qset_durability_service(qos, 0, DDS_HISTORY_KEEP_LAST, depth, -1, -1, -1);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, depth);
  if (deadline_s > 0.0) dds_qset_deadline(qos, (dds_duration_t)(deadline_s * 1e9));
  dds_qset_liveliness(qos, DDS_LIVELINESS_AUTOMATIC, (dds_duration_t)(lease_s * 1e9));
  if (partition != NULL) dds_qset_partition1(qos, partition);
  return qos;
}

static dds_entity_t topic(dds_entity_t participant, const dds_topic_descriptor_t* type, const char* name) {
  return required(dds_create_topic(participant, type, name, NULL, NULL), name);
}

static dds_entity_t reader(dds_entity_t participant, dds_entity_t of, dds_qos_t* qos) {
  const dds_entity_t subscriber = required(dds_create_subscriber(participant, qos, NULL), "subscriber");
  return required(dds_create_reader(subscriber, of, qos, NULL), "reader");
}

static dds_entity_t writer(dds_entity_t participant, dds_entity_t of, dds_qos_t* qos) {
  const dds_entity_t publisher = required(dds_create_publisher(participant, qos, NULL), "publisher");
  return required(dds_create_writer(publisher, of, qos, NULL), "writer");
}

/* The session of the world's run; 0: no world has described itself yet. */
static uint64_t session_of(dds_entity_t scenes) {
  void* sample = NULL;
  dds_sample_info_t info;
  uint64_t session = 0;
  while (dds_take(scenes, &sample, &info, 1, 1) == 1) {
    const subworld_msg_Scene* scene = sample;
    if (info.valid_data && scene->wire_version == WIRE_VERSION) session = scene->session;
    dds_return_loan(scenes, &sample, 1);
    sample = NULL;
  }
  return session;
}

static void send_status(dds_entity_t statuses, uint32_t user, double time_s, uint64_t steps) {
  subworld_msg_Status status;
  memset(&status, 0, sizeof status);
  status.program = DEVICE_SIM;
  status.instance = user;
  status.wire_version = WIRE_VERSION;
  status.state = "running";
  status.time_s = time_s;
  status.rate_hz = RATE_HZ;
  status.steps = steps;
  status.real_time_factor = 1.0;
  status.waits_for = "";
  status.text = "";
  dds_write(statuses, &status);
}

/* Moves along +x: at rest until 0.5 s after the first answer, 5 cm within 0.4 s, then held. */
static void move(subworld_msg_DeviceState* state, double answered_s) {
  const double part = answered_s < 0.0 ? 0.0 : fmin(fmax((state->stamp_s - answered_s - 0.5) / 0.4, 0.0), 1.0);
  state->pose.position[0] = 0.05 * part * part * (3.0 - 2.0 * part);
  state->linear_velocity[0] = part < 1.0 ? 0.05 * 6.0 * part * (1.0 - part) / 0.4 : 0.0;
  state->pose.orientation[0] = 1.0;
}

int main(int argc, char** argv) {
  if (argc != 3) {
    fprintf(stderr, "usage: foreign_device DOMAIN USER\n");
    return 2;
  }
  const uint32_t user = (uint32_t)atoi(argv[2]);
  char partition[32];
  snprintf(partition, sizeof partition, "device_%u", user);
  const double deadline_s = 2.9e-3; /* two periods, as the network page rounds them */
  dds_qos_t* const slow = quality(1, 16, 0.0, 3.0, NULL);
  dds_qos_t* const fast = quality(0, 8, deadline_s, 0.1, partition);
  const dds_entity_t me = required(dds_create_participant((dds_domainid_t)atoi(argv[1]), NULL, NULL), "participant");
  const dds_entity_t scenes = reader(me, topic(me, &subworld_msg_Scene_desc, "scene"), slow);
  const dds_entity_t statuses = writer(me, topic(me, &subworld_msg_Status_desc, "status"), slow);
  const dds_entity_t states = writer(me, topic(me, &subworld_msg_DeviceState_desc, "device_state"), fast);
  const dds_entity_t commands = reader(me, topic(me, &subworld_msg_DeviceCommand_desc, "device_command"), fast);

  subworld_msg_DeviceState state;
  memset(&state, 0, sizeof state);
  state.device = user;
  state.sender = ((uint64_t)getpid() << 32U) ^ (uint64_t)time(NULL);
  uint64_t answers = 0;
  double answered_s = -1.0;
  double force_n = 0.0, largest_n = 0.0;
  int last = 0;
  struct timespec next;
  clock_gettime(CLOCK_MONOTONIC, &next);
  for (uint64_t step = 0; !last && step < 60 * RATE_HZ; ++step) {
    const uint64_t session = session_of(scenes);
    if (session != 0) state.session = session;
    if (state.session != 0) {
      ++state.sequence_number;
      state.stamp_s = (double)state.sequence_number / RATE_HZ;
      move(&state, answered_s);
      dds_write(states, &state);
    }
    if (step % RATE_HZ == 0) send_status(statuses, user, state.stamp_s, step);

    void* sample = NULL;
    dds_sample_info_t info;
    while (dds_take(commands, &sample, &info, 1, 1) == 1) {
      const subworld_msg_DeviceCommand* command = sample;
      if (info.valid_data && command->session == state.session && command->served == state.sender) {
        if (answers++ == 0) answered_s = state.stamp_s;
        force_n = sqrt(pow(command->wrench.force[0], 2) + pow(command->wrench.force[1], 2) +
                       pow(command->wrench.force[2], 2));
        largest_n = fmax(largest_n, force_n);
        last = command->last;
      }
      dds_return_loan(commands, &sample, 1);
      sample = NULL;
    }
    next.tv_nsec += 1000000000 / RATE_HZ;
    next.tv_sec += next.tv_nsec / 1000000000;
    next.tv_nsec %= 1000000000;
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, NULL);
  }
  printf("{\"commands\": %llu, \"largest_n\": %g, \"at_end_n\": %g, \"last\": %d}\n", (unsigned long long)answers,
         largest_n, force_n, last);
  dds_delete_qos(slow);
  dds_delete_qos(fast);
  dds_delete(me);
  return last ? 0 : 1;
}
