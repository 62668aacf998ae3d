#pragma once

#include "process/process_test.hpp"

#include <algorithm>
#include <memory>
#include <set>
#include <sstream>
#include <string>
#include <vector>

namespace subworld::test {

/// Text of a light scene: every two users press one cube from both sides. The pairs are 0.4 m apart.
inline std::string pairs_scene(int users) {
  std::ostringstream text;
  text << "name: pairs\n"
          "settings: {duration_s: 0.15, settle: {duration_s: 0.1}, world: {engine: bullet}, haptic: {engine: bullet}}\n"
          "bodies:\n"
          "  - {name: floor, shape: plane, fixed: true}\n"
          "  - {name: cube, shape: box, size_m: [0.1, 0.1, 0.1], mass_kg: 0.2, position_m: [0, 0, 0.05], "
       << "repeat: {row: {count: " << (users + 1) / 2 << ", step_m: [0.4, 0, 0]}}}\n"
       << "users:\n";
  for (int u = 0; u < users; ++u) {
    const double side = u % 2 == 0 ? -1.0 : 1.0, cube_m = 0.4 * (u / 2);
    text << "  - {name: user_" << u << ", proxy: {shape: sphere, radius_m: 0.03, mass_kg: 0.1, rotates: false, "
         << "gravity: false, position_m: [" << cube_m + side * 0.085 << ", 0, 0.05]}, device: {path: [{move: ["
         << -side * 0.02 << ", 0, 0], during_s: [0.01, 0.09]}]}}\n";
  }
  return text.str();
}

class ManyUsers : public ProcessTest {
 protected:
  /// Hash of a run in lock-step by the launcher. Everybody must have pressed.
  std::string hash_of_run(int users, const Words& flags) const {
    Words all{"--mode", "lockstep"};
    all.insert(all.end(), flags.begin(), flags.end());
    const Ended ended = run(folder_.write("pairs.yaml", pairs_scene(users)), all);
    EXPECT_EQ(ended.code, 0) << ended.out << ended.err;
    const Json json = summary();
    if (json.is_discarded()) return {};
    EXPECT_EQ(json["haptic"].size(), static_cast<std::size_t>(users));
    for (const Json& haptic : json["haptic"]) {
      EXPECT_GT(haptic["force_max_n"], 1.0) << haptic["user"];
      EXPECT_EQ(haptic["lost_frames"], 0) << haptic["user"];
    }
    return json["state_hash"];
  }

  /// Hash of a run whose programs start in this order: -1 the world, 2 u the haptic_sim and 2 u + 1 the device_sim of
  /// user u. `dds` as of `subworld run`.
  std::string hash_of_start(int users, const std::vector<int>& order, const std::string& dds) const {
    const std::string file = folder_.write("pairs.yaml", pairs_scene(users));
    std::vector<std::unique_ptr<Process>> programs;
    for (const int one : order) {
      const std::string vendor = dds != "mixed" ? dds : one % 2 == 0 ? "fastdds" : "cyclonedds";
      const std::string name = one < 0 ? "world_sim" : one % 2 == 0 ? "haptic_sim" : "device_sim";
      const std::string own = folder_.path() + "/" + name + "_" + std::to_string(one);
      std::filesystem::create_directories(own);
      Words words{program(name), file, "--mode", "lockstep", "--domain", domain_.text(), "--dds", vendor, "--out", own};
      if (one >= 0) words.insert(words.end(), {"--user", std::to_string(one / 2)});
      programs.push_back(std::make_unique<Process>(words, own));
    }
    for (const auto& one : programs) EXPECT_EQ(one->wait(), 0) << one->err();
    const Json world = Json::parse(read_text(folder_.path() + "/world_sim_-1/world.json"), nullptr, false);
    return world.is_discarded() ? "" : world["state_hash"].get<std::string>();
  }

  [[nodiscard]] static std::vector<int> usual_order(int users) {
    std::vector<int> order;
    for (int one = -1; one < 2 * users; ++one) order.push_back(one);
    return order;
  }
};

}  // namespace subworld::test
