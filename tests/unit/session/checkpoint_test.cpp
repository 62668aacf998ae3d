#include "world_sim/checkpoint/checkpoint.hpp"

#include "model/error.hpp"
#include "support/temporary_folder.hpp"
#include "world_sim/world.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <string>

namespace subworld {
namespace {

Scene row() { return load_scene(std::string(SCENES_FOLDER) + "/row.yaml"); }

WorldCheckpoint sample(const Scene& scene) {
  WorldCheckpoint c{.settings = agreed_settings(scene),
                    .engine = "bullet",
                    .session = 7,
                    .stamp = 250,
                    .haptic_steps = 1000,
                    .time_s = 1.0,
                    .ratio = 4,
                    .planned = {240, 4},
                    .kinetic_j = 0.5,
                    .potential_j = -2.0,
                    .released_j = 0.25,
                    .states = scene.initial,
                    .asleep = {},
                    .devices = {{{0.1, 0.2, 0.3}, Quat::Identity()}},
                    .absences = {{0, 0.25, 0.5, false}}};
  c.asleep.resize(scene.bodies.size());
  c.states[1].linear_velocity = {0.1, -0.2, 0.3};
  return c;
}

std::string bytes_of(const WorldCheckpoint& checkpoint) {
  std::string bytes;
  encode(checkpoint, bytes);
  return bytes;
}

/// The text with which bytes are refused; empty: they are not.
std::string refusal(const std::string& bytes) {
  try {
    (void)decode_checkpoint(bytes, "FILE");
  } catch (const Error& wrong) {
    EXPECT_EQ(wrong.code(), ExitCode::failed);
    const std::string text = wrong.what();
    EXPECT_TRUE(text.starts_with("FILE: ")) << text;
    EXPECT_TRUE(text.ends_with("start the run anew without --resume")) << text;
    return text;
  }
  return {};
}

void write(const std::string& path, const std::string& bytes) { std::ofstream(path, std::ios::binary) << bytes; }

TEST(Checkpoint, ReadsBackWhatWasWritten) {
  const WorldCheckpoint one = sample(row());
  const std::string bytes = bytes_of(one);
  const WorldCheckpoint other = decode_checkpoint(bytes, "FILE");
  EXPECT_EQ(bytes_of(other), bytes);
  EXPECT_EQ(other.states[1].linear_velocity, one.states[1].linear_velocity);
  EXPECT_EQ(other.settings, one.settings);
  EXPECT_EQ(other.devices[0].position, one.devices[0].position);
  EXPECT_EQ(other.absences[0].to_s, 0.5);
}

TEST(Checkpoint, IsRefusedWithAnyByteFlippedOrMissing) {
  const std::string bytes = bytes_of(sample(row()));
  for (std::size_t at = 0; at < bytes.size(); ++at) {
    std::string damaged = bytes;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    ASSERT_FALSE(refusal(damaged).empty()) << at;
  }
  for (std::size_t size = 0; size < bytes.size(); size += 7) ASSERT_FALSE(refusal(bytes.substr(0, size)).empty());
  EXPECT_FALSE(refusal(bytes + "more").empty());
}

// With a right checksum: the values themselves are judged.
TEST(Checkpoint, ImpossibleValuesAreNamed) {
  const auto refused = [](auto change) {
    WorldCheckpoint c = sample(row());
    change(c);
    return refusal(bytes_of(c));
  };
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(refused([](auto& c) { c.states[2].position.x() = kNan; }).find("not finite"), std::string::npos);
  EXPECT_NE(refused([](auto& c) { c.released_j = kNan; }).find("not finite"), std::string::npos);
  EXPECT_NE(refused([](auto& c) { c.states[2].orientation.w() = 3.0; }).find("quaternion"), std::string::npos);
  EXPECT_NE(refused([](auto& c) { c.ratio = 0; }).find("ratio"), std::string::npos);
  EXPECT_NE(refused([](auto& c) { c.asleep.pop_back(); }).find("number of bodies"), std::string::npos);
  EXPECT_NE(refused([](auto& c) { c.devices[0].position.y() = kNan; }).find("device pose"), std::string::npos);
  EXPECT_NE(refused([](auto& c) { c.devices[0].orientation.x() = 3.0; }).find("quaternion"), std::string::npos);
  EXPECT_NE(refused([](auto& c) { c.absences[0].user = 1; }).find("absence of a user"), std::string::npos);
  EXPECT_NE(refused([](auto& c) { c.time_s = -1.0; }).find("before t = 0"), std::string::npos);
  // Bytes that claim more than they hold.
  const std::string bytes = bytes_of(sample(row()));
  for (std::size_t at = 32; at + 16 < bytes.size(); ++at) {
    std::string changed = bytes;
    changed[at] = static_cast<char>(changed[at] ^ 0xFF);
    seal_checkpoint(changed);
    (void)refusal(changed);  // accepted or refused, and nothing else
  }
}

TEST(Checkpoint, AnotherSceneIsRefusedByName) {
  const TemporaryFolder folder;
  const Scene scene = row();
  const std::string file = checkpoint_file(folder.path(), 0);
  write(file, bytes_of(sample(scene)));
  Scene other = scene;
  other.settings.set_ratio({8, 8});
  std::vector<std::string> skipped;
  EXPECT_NO_THROW((void)read_checkpoint(file, scene, skipped));
  try {
    (void)read_checkpoint(file, other, skipped);
    FAIL() << "accepted";
  } catch (const Error& wrong) {
    EXPECT_EQ(wrong.code(), ExitCode::usage);
    EXPECT_NE(std::string(wrong.what()).find("settings.ratio is 8, in the checkpoint 4"), std::string::npos)
        << wrong.what();
  }
}

TEST(Checkpoint, AFolderGivesItsNewestValidOne) {
  const TemporaryFolder folder;
  const Scene scene = row();
  std::vector<std::string> skipped;
  EXPECT_THROW((void)read_checkpoint(folder.path(), scene, skipped), Error);
  WorldCheckpoint older = sample(scene);
  write(checkpoint_file(folder.path(), 0), bytes_of(older));
  WorldCheckpoint newer = older;
  newer.stamp = 375;
  write(checkpoint_file(folder.path(), 1), bytes_of(newer));
  EXPECT_EQ(read_checkpoint(folder.path(), scene, skipped).stamp, 375U);
  EXPECT_EQ(next_checkpoint(folder.path()) % 2, 0U);
  write(checkpoint_file(folder.path(), 1), bytes_of(newer).substr(0, 1000));
  EXPECT_EQ(read_checkpoint(folder.path(), scene, skipped).stamp, 250U);
  EXPECT_EQ(skipped.size(), 1U);
  EXPECT_EQ(next_checkpoint(folder.path()) % 2, 1U);
}

// A body in flight goes on as if nothing had happened, one that sleeps stays asleep.
TEST(Checkpoint, AResumedWorldGoesOn) {
  Scene scene = row();
  keep_users(scene, 1);
  World world(scene);
  ASSERT_TRUE(world.settle([](double) { return true; }));
  for (int i = 0; i < 250; ++i) world.step();
  WorldCheckpoint c = sample(scene);
  copy_accounts(world, c);
  for (const Body& body : scene.bodies) {
    c.states[index(body.id)] = world.engine().state(body.id);
    c.asleep[index(body.id)] = world.engine().asleep(body.id) ? 1 : 0;
  }
  const Scene later = resumed_scene(scene, c);
  World resumed(later);
  resumed.resume(c);
  EXPECT_EQ(resumed.facts().stamp, world.facts().stamp);
  EXPECT_EQ(resumed.facts().time_s, world.facts().time_s);
  EXPECT_NEAR(resumed.facts().kinetic_j, world.facts().kinetic_j, 1e-9);
  EXPECT_NEAR(resumed.facts().potential_j, world.facts().potential_j, 1e-9);
  EXPECT_EQ(resumed.engine().asleep_count(), world.engine().asleep_count());
  for (int i = 0; i < 25; ++i) {
    world.step();
    resumed.step();
  }
  EXPECT_EQ(resumed.facts().stamp, world.facts().stamp);
  for (const Body& body : scene.bodies) {
    EXPECT_LT((resumed.engine().state(body.id).position - world.engine().state(body.id).position).norm(), 1e-3)
        << body.name;
  }
}

}  // namespace
}  // namespace subworld
