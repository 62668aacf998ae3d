#include "record/recording.hpp"

#include "judge/report.hpp"
#include "model/error.hpp"
#include "rt/wall_clock.hpp"
#include "wire/schema.hpp"
#include "wire/topics.hpp"

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <regex>
#include <string_view>
#include <utility>

namespace subworld {

namespace {

constexpr std::chrono::milliseconds kPeriod{10};
constexpr int kNice = 5;  // as the display: the loops that compute forces come first

// Each ring holds what its program sends in a second or more.
constexpr std::size_t kMegabyte = 1U << 20U, kHaptic_bytes = 4 * kMegabyte, kDevice_bytes = kMegabyte,
                      kDisplay_bytes = kMegabyte, kWorld_bytes = 16 * kMegabyte, kWorldUser_bytes = 2 * kMegabyte,
                      kWorldBody_bytes = 2048;

std::vector<std::size_t> ring_sizes(const Scene& scene, bool display) {
  const int users = scene.settings.users;
  std::vector<std::size_t> sizes(static_cast<std::size_t>(places_of_messages(users)));
  const auto size_of = [&](const char* program, int user) -> std::size_t& {
    return sizes[static_cast<std::size_t>(place_of_messages(program, user))];
  };
  size_of("world_sim", -1) =
      kWorld_bytes + kWorldUser_bytes * static_cast<std::size_t>(users) + kWorldBody_bytes * scene.bodies.size();
  size_of("gui_headless", -1) = display ? kDisplay_bytes : 0;
  for (int user = 0; user < users; ++user) {
    size_of("haptic_sim", user) = kHaptic_bytes;
    size_of("device_sim", user) = kDevice_bytes;
  }
  return sizes;
}

bool is_of_user(std::size_t topic) {
  return topic == kTopicIndex<DeviceState> || topic == kTopicIndex<DeviceCommand> || topic == kTopicIndex<WorldFrame> ||
         topic == kTopicIndex<HapticReport>;
}

std::string text_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file)
    throw Error(ExitCode::failed, fmt::format("{}: cannot be read, so it is not in the recording", path.string()));
  return {std::istreambuf_iterator<char>(file), {}};
}

std::uint64_t attached_at() { return static_cast<std::uint64_t>(wall_ns()); }

}  // namespace

void to_json(Json& json, const RecordingResult& result) {
  json = {{"file", result.file},
          {"messages_sent", result.sent},
          {"messages_recorded", result.recorded},
          {"messages_lost", result.lost()},
          {"bytes", result.bytes},
          {"cpu_s", result.cpu_s},
          {"topics", result.topics}};
  if (!result.fault.empty()) json["fault"] = result.fault;
}

std::vector<std::string> files_of_scene(const std::string& text) {
  static const std::regex kFile(R"((?:^|[\s{,])file:\s*["']?([^"',}\s]+))");
  std::vector<std::string> files;
  for (std::sregex_iterator at(text.begin(), text.end(), kFile), end; at != end; ++at) {
    const std::filesystem::path path = (*at)[1].str();
    const bool inside = path.is_relative() && std::ranges::find(path, "..") == path.end();
    if (inside && std::ranges::find(files, path.string()) == files.end()) files.push_back(path);
  }
  return files;
}

Recording::Recording(const std::string& file, const Scene& scene, const std::vector<std::string>& flags,
                     const std::string& dds, bool display)
    : memory_(ring_sizes(scene, display), scene.settings.mode == Mode::lockstep), writer_(file) {
  result_.file = file;
  constexpr std::string_view kModule = "subworld::msg::";
  for (std::size_t topic = 0; topic < kTopics.size(); ++topic) {
    const std::string type = kTopics[topic].type;
    schemas_[topic] = writer_.add_schema(type, "omgidl", schema_of(wire_idl(), type.substr(kModule.size())));
    const int users = is_of_user(topic) ? scene.settings.users : 1;
    for (int user = 0; user < users; ++user) (void)channel_of(topic, static_cast<std::uint32_t>(user));
  }
  attach_scene(scene, flags, dds);
}

Recording::~Recording() {
  ended_ = true;
  if (thread_.joinable()) thread_.join();
}

void Recording::attach_scene(const Scene& scene, const std::vector<std::string>& flags, const std::string& dds) {
  const std::string text = text_of(scene.file);
  writer_.attach(kSceneAttachment, "application/yaml", text, attached_at());
  const auto folder = std::filesystem::path(scene.file).parent_path();
  for (const std::string& file : files_of_scene(text))
    writer_.attach(file, "application/octet-stream", text_of(folder / file), attached_at());
  const Json settings{{"scene_file", scene.file}, {"flags", flags}, {"dds", dds}};
  writer_.attach(kSettingsAttachment, "application/json", settings.dump(2), attached_at());
}

std::uint16_t Recording::channel_of(std::size_t topic, std::uint32_t user) {
  Channel& channel = channels_[{topic, user}];
  if (channel.id == 0) {
    channel.topic = is_of_user(topic) ? fmt::format("/user_{}/{}", user, kTopics[topic].name)
                                      : fmt::format("/{}", kTopics[topic].name);
    channel.id = writer_.add_channel(schemas_.at(topic), channel.topic, "cdr");
    result_.topics[channel.topic] = 0;
  }
  return channel.id;
}

void Recording::start() {
  // Signals go to the main thread.
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  thread_ = std::thread([this] { work(); });
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

void Recording::work() {
  (void)setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNice);
  while (!ended_) {
    write_arrived(false);
    std::this_thread::sleep_for(kPeriod);
  }
  write_arrived(true);
  timespec used{};
  if (clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used) == 0)
    result_.cpu_s = static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
}

void Recording::write_arrived(bool last) {
  try {
    memory_.take(arrived_, last);
    std::ranges::stable_sort(arrived_, {}, &RecordedMessage::time_ns);
    for (const RecordedMessage& message : arrived_) {
      if (!result_.fault.empty()) break;  // the rings are emptied all the same: no program waits
      const std::uint16_t channel = channel_of(message.topic, message.user);
      writer_.write(channel, message.number, static_cast<std::uint64_t>(message.time_ns), message.cdr);
      ++result_.topics[channels_[{message.topic, message.user}].topic];
      ++result_.recorded;
    }
    if (last && result_.fault.empty()) writer_.flush();
  } catch (const std::exception& fault) {
    result_.fault = fault.what();
    result_.recorded -= std::min(result_.recorded, writer_.unwritten());
  }
  arrived_.clear();
}

RecordingResult Recording::drain() {
  ended_ = true;
  if (thread_.joinable()) thread_.join();
  for (const std::uint64_t sent : memory_.counts().sent) result_.sent += sent;
  result_.bytes = writer_.bytes();
  return result_;
}

void Recording::finish(const std::string& summary_file) {
  if (!result_.fault.empty()) return;
  writer_.attach(kSummaryAttachment, "application/json", text_of(summary_file), attached_at());
  writer_.finish();
}

}  // namespace subworld
