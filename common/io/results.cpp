#include "io/results.hpp"

#include "model/error.hpp"
#include "rt/stages.hpp"

#include <fmt/format.h>
#include <sys/utsname.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <thread>

namespace subworld {

Json quantiles(const Histogram& h) {
  return {{"p50", h.quantile_s(0.5)},
          {"p99", h.quantile_s(0.99)},
          {"p99_9", h.quantile_s(0.999)},
          {"max", h.max_s()},
          {"mean", h.mean_s()}};
}

Json stages(std::span<const Histogram> times, std::span<const char* const> names) {
  const auto total_s = [](const Histogram& h) { return h.mean_s() * static_cast<double>(h.count()); };
  double working_s = 0.0;
  for (std::size_t i = 0; i < times.size(); ++i) working_s += i == kWaitingStage ? 0.0 : total_s(times[i]);
  Json json = Json::object();
  for (std::size_t i = 0; i < times.size(); ++i) {
    Json stage = quantiles(times[i]);
    if (i != kWaitingStage) stage["share"] = working_s > 0.0 ? total_s(times[i]) / working_s : 0.0;
    json[fmt::format("{}_s", names[i])] = std::move(stage);
  }
  return json;
}

Json mean_max(const MeanMax& values) { return {{"mean", values.mean()}, {"max", values.max}}; }

Json operator_energy(double net_j, double least_j, double created_j) {
  return {{"net_j", net_j}, {"least_j", least_j}, {"created_j", created_j}};
}

Json to_json(const EventCounts& events) {
  return {{"deadline_missed", events.deadline_missed},
          {"liveliness_lost", events.liveliness_lost},
          {"incompatible_qos", events.incompatible_qos},
          {"lost", events.lost},
          {"rejected", events.rejected},
          {"refused", events.refused}};
}

std::string to_text(const EngineChange& change) {
  return fmt::format("engine {} -> {} at {:.3f} s, in {:.2f} ms", change.from, change.to, change.at_s,
                     1e3 * change.exchange_s);
}

Json to_json(const EngineChange& change) {
  return {{"at_s", change.at_s},
          {"from", change.from},
          {"to", change.to},
          {"exchange_s", change.exchange_s},
          {"force_step_n", change.force_step_n},
          {"force_step_before_n", change.force_step_before_n}};
}

Json to_json(std::span<const PlannedItem> plan) {
  Json json = Json::array();
  for (const PlannedItem& planned : plan) {
    json.push_back(
        {{"item", planned.item->name}, {"enabled", planned.decision.enabled}, {"because", planned.decision.because}});
    if (planned.item->of_user) json.back()["user"] = planned.user;
  }
  return json;
}

void make_folder(const std::string& folder) {
  std::error_code wrong;
  std::filesystem::create_directories(folder, wrong);
  if (wrong || !std::filesystem::is_directory(folder)) {
    throw Error(ExitCode::failed, fmt::format("{}: cannot create the folder ({}); choose another one with --out",
                                              folder, wrong.message()));
  }
}

void write_json(const std::string& path, const Json& json) {
  const std::string unfinished = path + ".part";
  {
    std::ofstream file(unfinished);
    file << json.dump(2) << '\n';
    if (!file.flush()) throw Error(ExitCode::failed, fmt::format("{}: cannot write; is the disk full?", path));
  }
  std::filesystem::rename(unfinished, path);
}

Json read_json(const std::string& path) {
  std::ifstream file(path);
  if (!file)
    throw Error(ExitCode::failed, fmt::format("{}: cannot read; did the program that writes it end early?", path));
  try {
    return Json::parse(file);
  } catch (const nlohmann::json::exception& wrong) {
    throw Error(ExitCode::failed, fmt::format("{}: {}", path, wrong.what()));
  }
}

int machine_cores() { return static_cast<int>(std::max(1U, std::thread::hardware_concurrency())); }

Json machine() {
  utsname system{};
  uname(&system);
  std::ifstream cpus("/proc/cpuinfo");
  std::string line, model = "unknown";
  while (std::getline(cpus, line)) {
    if (line.starts_with("model name")) {
      model = line.substr(line.find(':') + 2);
      break;
    }
  }
  return {{"cpu", model},
          {"cores", machine_cores()},
          {"kernel", system.release},
          {"system", system.sysname},
          {"compiler", __VERSION__}};
}

}  // namespace subworld
