/* A program of ROS 2, as far as the network can tell: C types that `idlc` made of ros2.idl, and Cyclone DDS.

   ros2_peer DOMAIN: reads what `subworld ros2` publishes, and presses 5 cm along +x as the device of user 0. After 3 s
   of forces it prints what it has received. */
#include <dds/dds.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "ros2.h"

enum { RATE_HZ = 1000, SECONDS = 3, LIMIT_S = 60 };

static dds_entity_t required(dds_entity_t entity, const char* what) {
  if (entity >= 0) return entity;
  fprintf(stderr, "ros2_peer: error: %s: %s\n", what, dds_strretcode(entity));
  exit(3);
}

/* ROS 2's default: reliable, volatile, the last 10. */
static dds_qos_t* quality(void) {
  dds_qos_t* qos = dds_create_qos();
  const dds_data_representation_id_t plain_cdr = DDS_DATA_REPRESENTATION_XCDR1;
  dds_qset_data_representation(qos, 1, &plain_cdr);
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_MSECS(100));
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 10);
  return qos;
}

static dds_entity_t reader(dds_entity_t me, const dds_topic_descriptor_t* type, const char* topic) {
  return required(
      dds_create_reader(me, required(dds_create_topic(me, type, topic, NULL, NULL), topic), quality(), NULL), topic);
}

/* Takes one sample; the caller returns the loan. */
static void* taken(dds_entity_t from) {
  void* sample = NULL;
  dds_sample_info_t info;
  while (dds_take(from, &sample, &info, 1, 1) == 1) {
    if (info.valid_data) return sample;
    dds_return_loan(from, &sample, 1);
    sample = NULL;
  }
  return NULL;
}
static void give_back(dds_entity_t to, void* sample) { dds_return_loan(to, &sample, 1); }

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const dds_entity_t me = required(dds_create_participant((dds_domainid_t)atoi(argv[1]), NULL, NULL), "participant");
  const dds_entity_t wrenches = reader(me, &geometry_msgs_msg_dds__WrenchStamped__desc, "rt/subworld/user_0/wrench");
  const dds_entity_t poses = reader(me, &geometry_msgs_msg_dds__PoseStamped__desc, "rt/subworld/user_0/pose");
  const dds_entity_t clocks = reader(me, &rosgraph_msgs_msg_dds__Clock__desc, "rt/clock");
  const dds_entity_t transforms = reader(me, &tf2_msgs_msg_dds__TFMessage__desc, "rt/tf");
  const dds_entity_t markers = reader(me, &visualization_msgs_msg_dds__MarkerArray__desc, "rt/subworld/markers");
  const dds_entity_t joints = reader(me, &sensor_msgs_msg_dds__JointState__desc, "rt/joint_states");
  const dds_entity_t moves =
      required(dds_create_writer(me,
                                 required(dds_create_topic(me, &geometry_msgs_msg_dds__PoseStamped__desc,
                                                           "rt/subworld/user_0/command_pose", NULL, NULL),
                                          "topic"),
                                 quality(), NULL),
               "writer");
  long of_wrench = 0, of_pose = 0, of_clock = 0, of_tf = 0, of_markers = 0, shown = 0;
  double least_n = 0.0, x_m = 0.0, clock_s = 0.0;
  char frame[64] = "", body[64] = "", joint[64] = "";
  double turn_least = 1.0, turn_most = -1.0, turn_rate = 0.0;
  geometry_msgs_msg_dds__PoseStamped_ move;
  memset(&move, 0, sizeof move);
  move.header.frame_id = "world";
  move.pose.orientation.w = 1.0;
  struct timespec next;
  clock_gettime(CLOCK_MONOTONIC, &next);
  for (long step = 0; of_wrench < SECONDS * RATE_HZ && step < LIMIT_S * RATE_HZ; ++step) {
    void* sample;
    while ((sample = taken(wrenches)) != NULL) {
      const geometry_msgs_msg_dds__WrenchStamped_* wrench = sample;
      ++of_wrench;
      least_n = fmin(least_n, wrench->wrench.force.x);
      snprintf(frame, sizeof frame, "%s", wrench->header.frame_id);
      give_back(wrenches, sample);
    }
    while ((sample = taken(poses)) != NULL) {
      ++of_pose;
      x_m = ((geometry_msgs_msg_dds__PoseStamped_*)sample)->pose.position.x;
      give_back(poses, sample);
    }
    while ((sample = taken(clocks)) != NULL) {
      const builtin_interfaces_msg_dds__Time_* now = &((rosgraph_msgs_msg_dds__Clock_*)sample)->clock;
      ++of_clock;
      clock_s = now->sec + 1e-9 * now->nanosec;
      give_back(clocks, sample);
    }
    while ((sample = taken(transforms)) != NULL) {
      const tf2_msgs_msg_dds__TFMessage_* tf = sample;
      ++of_tf;
      if (tf->transforms._length > 0) snprintf(body, sizeof body, "%s", tf->transforms._buffer[0].child_frame_id);
      give_back(transforms, sample);
    }
    while ((sample = taken(markers)) != NULL) {
      const visualization_msgs_msg_dds__MarkerArray_* all = sample;
      ++of_markers;
      shown = 0;
      for (uint32_t i = 0; i < all->markers._length; ++i)
        shown += all->markers._buffer[i].scale.x > 0.0 && all->markers._buffer[i].color.a == 1.0F;
      give_back(markers, sample);
    }
    while ((sample = taken(joints)) != NULL) {
      const sensor_msgs_msg_dds__JointState_* all = sample;
      if (all->name._length == 1 && all->position._length == 1 && all->velocity._length == 1) {
        snprintf(joint, sizeof joint, "%s", all->name._buffer[0]);
        turn_least = fmin(turn_least, all->position._buffer[0]);
        turn_most = fmax(turn_most, all->position._buffer[0]);
        turn_rate = fmax(turn_rate, all->velocity._buffer[0]);
      }
      give_back(joints, sample);
    }
    const double part = fmin(fmax((double)(of_wrench - RATE_HZ / 2) / 400.0, 0.0), 1.0);
    move.pose.position.x = 0.05 * part * part * (3.0 - 2.0 * part);
    dds_write(moves, &move);
    next.tv_nsec += 1000000000L / RATE_HZ;
    if (next.tv_nsec >= 1000000000L) next.tv_nsec -= 1000000000L, ++next.tv_sec;
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, NULL);
  }
  printf(
      "wrenches %ld poses %ld clocks %ld transforms %ld markers %ld shown %ld least_n %.2f x_m %.3f clock_s %.2f "
      "frame %s body %s joint %s turn_least %.4f turn_most %.4f turn_rate %.4f\n",
      of_wrench, of_pose, of_clock, of_tf, of_markers, shown, least_n, x_m, clock_s, frame, body, joint, turn_least,
      turn_most, turn_rate);
  dds_delete(me);
  return of_wrench >= SECONDS * RATE_HZ ? 0 : 1;
}
