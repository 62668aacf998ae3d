#include "io/results/results.hpp"

#include "io/results/json.hpp"
#include "model/error.hpp"
#include "rt/stages.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <thread>

namespace subworld {

Quantiles quantiles(const Histogram& h) {
  return {h.quantile_s(0.5), h.quantile_s(0.99), h.quantile_s(0.999), h.max_s(), h.mean_s()};
}

StageTimes stages(std::span<const Histogram> times, std::span<const char* const> names) {
  const auto total_s = [](const Histogram& h) { return h.mean_s() * static_cast<double>(h.count()); };
  double working_s = 0.0;
  for (std::size_t i = 0; i < times.size(); ++i) working_s += i == kWaitingStage ? 0.0 : total_s(times[i]);
  StageTimes stages;
  for (std::size_t i = 0; i < times.size(); ++i) {
    StageTime& stage = stages.all.emplace_back(StageTime{quantiles(times[i]), names[i]});
    if (i != kWaitingStage) stage.share = working_s > 0.0 ? total_s(times[i]) / working_s : 0.0;
  }
  return stages;
}

SUBWORLD_JSON(Quantiles, p50, p99, p99_9, max, mean)
SUBWORLD_JSON(EngineChange, at_s, from, to, exchange_s, force_step_n, force_step_before_n)
SUBWORLD_JSON(EventCounts, deadline_missed, liveliness_lost, incompatible_qos, lost, rejected, refused)

void to_json(Json& json, const MeanMax& values) { json = {{"mean", values.mean()}, {"max", values.max}}; }
void from_json(const Json& json, MeanMax& values) { values = {json.at("mean"), json.at("max"), 1}; }

void to_json(Json& json, const StageTimes& stages) {
  json = Json::object();
  for (const StageTime& stage : stages.all) {
    Json& one = json[stage.name + "_s"] = static_cast<const Quantiles&>(stage);
    put(one, "share", stage.share);
  }
}

void from_json(const Json& json, StageTimes& stages) {
  for (const auto& [key, one] : json.items()) {
    StageTime& stage = stages.all.emplace_back(StageTime{one.get<Quantiles>(), key.substr(0, key.size() - 2)});
    get(one, "share", stage.share);
  }
}

std::string to_text(const EngineChange& change) {
  return fmt::format("engine {} -> {} at {:.3f} s, in {:.2f} ms", change.from, change.to, change.at_s,
                     1e3 * change.exchange_s);
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

namespace {

/// Where a file of results is until it is complete.
std::string unfinished_of(const std::string& path) { return path + ".part"; }

[[noreturn]] void refuse_write(const std::string& path, int error) {
  throw Error(ExitCode::failed, fmt::format("{}: {}{}", path, std::strerror(error),
                                            error == ENOSPC || error == EDQUOT
                                                ? "; free some disk space, or choose another folder with --out"
                                                : "; choose another folder with --out"));
}

int open_unfinished(const std::string& path) {
  return open(unfinished_of(path).c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0644);
}

/// 0, or the error number.
int write_whole(int file, const std::string& text) {
  for (std::size_t done = 0; done < text.size();) {
    const ssize_t written = write(file, text.data() + done, text.size() - done);
    if (written < 0 && errno != EINTR) return errno;
    if (written > 0) done += static_cast<std::size_t>(written);
  }
  return ftruncate(file, static_cast<off_t>(text.size())) == 0 ? 0 : errno;
}

}  // namespace

ReservedFile::ReservedFile(const std::string& path, std::size_t bytes) {
  if (path.empty()) return;
  const int file = open_unfinished(path);
  if (file < 0) refuse_write(path, errno);
  unfinished_ = unfinished_of(path);
  // Some file systems cannot reserve: there the end of the run shows whether there is space.
  const int error = fallocate(file, 0, 0, static_cast<off_t>(bytes)) == 0 ? 0 : errno;
  close(file);
  if (error != ENOSPC && error != EDQUOT) return;
  unlink(unfinished_.c_str());
  refuse_write(path, error);
}

ReservedFile::~ReservedFile() {
  if (!unfinished_.empty()) unlink(unfinished_.c_str());
}

void write_json(const std::string& path, const Json& json) {
  const std::string unfinished = unfinished_of(path);
  int file = open_unfinished(path);
  if (file < 0 && errno == ENOENT) {
    make_folder(std::filesystem::path(path).parent_path());
    file = open_unfinished(path);
  }
  if (file < 0) refuse_write(path, errno);
  int error = write_whole(file, json_text(json, 2) + '\n');
  if (close(file) != 0 && error == 0) error = errno;
  if (error == 0 && std::rename(unfinished.c_str(), path.c_str()) != 0) error = errno;
  if (error == 0) return;
  unlink(unfinished.c_str());
  refuse_write(path, error);
}

Json read_json(const std::string& path) {
  std::ifstream file(path);
  if (!file)
    throw Error(ExitCode::failed, fmt::format("{}: {}{}", path, std::strerror(errno),
                                              errno == ENOENT ? "; did the program that writes it end early?" : ""));
  try {
    return parse_json(std::string{std::istreambuf_iterator<char>(file), {}});
  } catch (const Error& wrong) {
    throw Error(wrong.code(), fmt::format("{}: {}", path, wrong.what()));
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

Json json_of(const Setting& setting, Settings& settings, UserSpec& user) {
  const std::optional<std::string> text = value_text(setting, settings, user);
  if (!text) return nullptr;
  try {
    return parse_json(*text);
  } catch (const Error&) {
    return *text;
  }
}

}  // namespace subworld
