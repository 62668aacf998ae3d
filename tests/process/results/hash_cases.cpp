#include "process/results/hash_cases.hpp"

#include "io/options/options.hpp"
#include "lab/session/coupled_run.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <filesystem>

namespace subworld::test {

namespace {

constexpr double kLatency_s = 0.02;

std::string file_of(const std::string& folder, const std::string& scene) { return folder + "/" + scene + ".yaml"; }

/// Simulated time: long enough for a contact at the border, short where a step takes long.
double duration_s(const std::string& scene) { return scene == "basin" ? 0.06 : 0.4; }

Options options_of(const HashCase& one, const std::string& folder) {
  Options options;
  options.scene = file_of(folder, one.scene);
  change(options, "mode", "lockstep");
  change(options, "scheme", one.scheme);
  change(options, "users", std::to_string(one.users));
  change(options, "delay.latency_s", fmt::format("{}", one.latency_s));
  change(options, "duration_s", fmt::format("{}", duration_s(one.scene)));
  return options;
}

int most_users(const std::string& folder, const std::string& scene) {
  const Scene declared = load_scene(file_of(folder, scene));
  return std::min(2, static_cast<int>(declared.users.size()));
}

}  // namespace

std::vector<HashCase> hash_cases(const std::string& folder, const std::vector<std::string>& scenes) {
  std::vector<std::string> names = scenes;
  if (names.empty()) {
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
      if (entry.path().extension() == ".yaml") names.push_back(entry.path().stem());
    }
  }
  std::ranges::sort(names);
  std::vector<HashCase> cases;
  for (const std::string& scene : names) {
    for (const char* scheme : {"direct", "paper", "reduced"}) {
      for (int users = 1; users <= most_users(folder, scene); ++users) {
        for (const double latency_s : {0.0, kLatency_s}) cases.push_back({scene, scheme, users, latency_s});
      }
    }
  }
  return cases;
}

std::string to_text(const HashCase& one) {
  return fmt::format("{},{},{},{:g}", one.scene, one.scheme, one.users, one.latency_s);
}

std::vector<std::string> flags_of(const HashCase& one) {
  return {"--mode",     "lockstep",
          "--scheme",   one.scheme,
          "--users",    std::to_string(one.users),
          "--latency",  fmt::format("{:g}", one.latency_s),
          "--duration", fmt::format("{:g}", duration_s(one.scene))};
}

std::string in_process_hash(const HashCase& one, const std::string& folder) {
  CoupledRun run(load_scene(options_of(one, folder)));
  run.run();
  run.close();
  return fmt::format("{:016x}", run.world.facts().state_hash);
}

}  // namespace subworld::test
