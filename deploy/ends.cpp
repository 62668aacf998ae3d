#include "ends.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

namespace subworld {

namespace {

constexpr double kLateStart_cycles = 10.0;  // in real time a user's first frame may be one of the next
constexpr double kLateEnd_cycles = 20.0;    // and the sub-world may lag behind the world
constexpr double kLateEnd_s = 0.25;

bool stopped_by_signal(const Json& ending) { return ending["by"].get<std::string>().starts_with("SIG"); }

std::string stopped_text(const Json& ending, double duration_s) {
  return fmt::format("was stopped by {} at t = {:.3f} of {:g} s", ending["by"].get<std::string>(),
                     ending["to_s"].get<double>(), duration_s);
}

}  // namespace

std::string early_end(const std::string& part_file, double duration_s) {
  if (!std::filesystem::exists(part_file)) return {};
  const Json ending = read_json(part_file)["ending"];
  return stopped_by_signal(ending) ? stopped_text(ending, duration_s) : "";
}

std::vector<std::string> faults_of(const Json& summary) {
  std::vector<std::string> faults;
  const Json& world = summary["world"]["ending"];
  const double duration_s = summary["duration_s"].get<double>();
  const double cycle_s = summary["h_s"].get<double>() * summary["ratio_most"].get<double>();
  const auto check = [&](const std::string& who, const Json& ending) {
    if (stopped_by_signal(ending)) faults.push_back(who + " " + stopped_text(ending, duration_s));
    if (const auto fault = ending["fault"].get<std::string>(); !fault.empty()) faults.push_back(who + ": " + fault);
    if (ending["session"] != world["session"]) faults.push_back(who + " took part in another world's run");
  };
  check("world_sim", world);
  const double end_s = world["to_s"].get<double>();
  for (const Json& haptic : summary["haptic"]) {
    const Json& ending = haptic["ending"];
    const std::string who = fmt::format("haptic_sim_{}", haptic["user"].get<int>());
    check(who, ending);
    const double from_s = ending["from_s"].get<double>(), to_s = ending["to_s"].get<double>();
    if (from_s > kLateStart_cycles * cycle_s || to_s < end_s - std::max(kLateEnd_s, kLateEnd_cycles * cycle_s))
      faults.push_back(fmt::format("{} served its user from {:.3f} to {:.3f} s, the world ran to {:.3f} s", who, from_s,
                                   to_s, end_s));
  }
  for (const Json& device : summary["device"])
    check(fmt::format("device_sim_{}", device["user"].get<int>()), device["ending"]);
  return faults;
}

}  // namespace subworld
