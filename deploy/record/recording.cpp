#include "record/recording.hpp"

#include "io/records/mcap_reader.hpp"
#include "io/results/json.hpp"
#include "model/error.hpp"
#include "rt/cyclic.hpp"
#include "rt/wall_clock.hpp"
#include "wire/codec/schema.hpp"
#include "wire/topics.hpp"

#include <fmt/core.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <ctime>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <string_view>
#include <utility>

namespace subworld {

namespace {

constexpr std::chrono::milliseconds kPeriod{10};
constexpr int kNice = 5;  // as the display: the loops that compute forces come first
constexpr const char* kPartAttachment = "part.json";

bool is_of_user(std::size_t topic) {
  return topic == kTopicIndex<DeviceState> || topic == kTopicIndex<DeviceCommand> || topic == kTopicIndex<WorldFrame> ||
         topic == kTopicIndex<HapticReport>;
}

/// In the file.
std::string topic_name(std::size_t topic, std::uint32_t user) {
  return is_of_user(topic) ? fmt::format("/user_{}/{}", user, kTopics[topic].name)
                           : fmt::format("/{}", kTopics[topic].name);
}

std::string text_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file)
    throw Error(ExitCode::failed, fmt::format("{}: cannot be read, so it is not in the recording", path.string()));
  return {std::istreambuf_iterator<char>(file), {}};
}

std::int64_t steady_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now().time_since_epoch()).count();
}

std::uint64_t attached_at() { return static_cast<std::uint64_t>(wall_ns()); }

/// The messages of a part, in the order of time.
class PartMessages {
 public:
  explicit PartMessages(const RecordingPart& part)
      : reader_(part.file), ahead_ns_(static_cast<std::int64_t>(1e9 * part.ahead_s)) {
    next();
  }
  [[nodiscard]] bool ended() const noexcept { return at_ == chunk_.messages.size(); }
  /// By the clock of this machine.
  [[nodiscard]] std::int64_t time_ns() const {
    return static_cast<std::int64_t>(chunk_.messages[at_].time_ns) - ahead_ns_;
  }
  void write_to(RecordingFile& file) const {
    const mcap::Message& message = chunk_.messages[at_];
    file.write(reader_.topics().at(message.channel), message.number, time_ns(), message.data);
  }
  void next() {
    ++at_;
    while (at_ >= chunk_.messages.size() && number_ < reader_.chunks()) {
      chunk_ = reader_.read_chunk(number_++);
      at_ = 0;
    }
    at_ = std::min(at_, chunk_.messages.size());
  }
  /// What its recorder counted.
  [[nodiscard]] Json figures() {
    if (!reader_.lacks().empty()) throw Error(ExitCode::failed, reader_.lacks());
    return parse_json(reader_.attachments().at(kPartAttachment));
  }

 private:
  mcap::Reader reader_;
  std::int64_t ahead_ns_;
  mcap::Chunk chunk_;
  std::size_t number_ = 0, at_ = 0;  // of the next chunk, of the message in this one
};

/// Writes the messages of all parts in the order of time. Returns what their recorders counted.
RecordingResult merge(const std::vector<RecordingPart>& parts, RecordingFile& file) {
  RecordingResult sum;
  std::vector<std::unique_ptr<PartMessages>> open;
  for (const RecordingPart& part : parts) {
    try {
      open.push_back(std::make_unique<PartMessages>(part));
      const Json figures = open.back()->figures();
      sum.sent += figures.at("messages_sent").get<std::uint64_t>();
      sum.cpu_s += figures.at("cpu_s").get<double>();
    } catch (const std::exception& fault) {
      sum.fault = fmt::format("not all messages of host {}: {}", part.host, fault.what());
    }
  }
  for (;;) {
    std::erase_if(open, [](const auto& part) { return part->ended(); });
    if (open.empty()) return sum;
    const auto& first = *std::ranges::min_element(open, {}, [](const auto& part) { return part->time_ns(); });
    first->write_to(file);
    first->next();
  }
}

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

std::size_t place_of_messages(const std::string& program, int user) {
  if (user < 0) return program == "world_sim" ? 0 : 1;
  return static_cast<std::size_t>(2 + 2 * user + (program == "haptic_sim" ? 0 : 1));
}

std::size_t places_of_messages(int users) { return static_cast<std::size_t>(2 + 2 * users); }

std::vector<std::size_t> sizes_of_messages(const Scene& scene, bool display, bool recorded) {
  constexpr std::size_t kMegabyte = 1U << 20U, kHaptic_bytes = 4 * kMegabyte, kWorld_bytes = 16 * kMegabyte,
                        kWorldUser_bytes = 2 * kMegabyte, kWorldBody_bytes = 2048, kUnrecordedUser_bytes = 1U << 17U;
  const auto users = static_cast<std::size_t>(scene.settings.users);
  std::vector<std::size_t> sizes(places_of_messages(scene.settings.users), kMegabyte);
  sizes[place_of_messages("world_sim", -1)] =
      recorded ? kWorld_bytes + kWorldUser_bytes * users + kWorldBody_bytes * scene.bodies.size()
               : std::max(kMegabyte, kUnrecordedUser_bytes * users);
  if (!display) sizes[place_of_messages("gui_headless", -1)] = 0;
  for (int user = 0; recorded && user < scene.settings.users; ++user)
    sizes[place_of_messages("haptic_sim", user)] = kHaptic_bytes;
  return sizes;
}

bool stays_inside(const std::filesystem::path& file) {
  return file.is_relative() && std::ranges::find(file, "..") == file.end();
}

RecordingFile::RecordingFile(const std::string& path, const RecordedRun& run) : writer_(path) {
  result_.file = path;
  constexpr std::string_view kModule = "subworld::msg::";
  for (std::size_t topic = 0; topic < kTopics.size(); ++topic) {
    const std::string type = kTopics[topic].type;
    const std::uint16_t schema = writer_.add_schema(type, "omgidl", schema_of(wire_idl(), type.substr(kModule.size())));
    const int users = is_of_user(topic) ? run.scene.settings.users : 1;
    for (int user = 0; user < users; ++user) {
      const std::string name = topic_name(topic, static_cast<std::uint32_t>(user));
      channels_[name] = writer_.add_channel(schema, name, "cdr");
      result_.topics[name] = 0;
    }
  }
  const std::string text = text_of(run.scene.file);
  writer_.attach(kSceneAttachment, "application/yaml", text, attached_at());
  const auto folder = std::filesystem::path(run.scene.file).parent_path();
  std::set<std::string> files;
  for (const Mesh& mesh : run.scene.meshes) {
    if (!mesh.file.empty() && stays_inside(mesh.file) && files.insert(mesh.file).second)
      writer_.attach(mesh.file, "application/octet-stream", text_of(folder / mesh.file), attached_at());
  }
  const auto here = std::filesystem::absolute(path).parent_path();
  const Json settings{{"scene_file", run.scene.file},
                      {"flags", run.flags},
                      {"dds", run.dds},
                      {"results", std::filesystem::proximate(run.out, here).string()}};
  writer_.attach(kSettingsAttachment, "application/json", json_text(settings, 2), attached_at());
  if (!run.begun.empty()) writer_.attach(kBegunAttachment, "application/json", run.begun, attached_at());
}

void RecordingFile::write(const std::string& topic, std::uint32_t number, std::int64_t time_ns,
                          std::span<const std::uint8_t> cdr) {
  const auto channel = channels_.find(topic);
  if (channel == channels_.end()) return;  // of a user that the run does not have
  writer_.write(channel->second, number, static_cast<std::uint64_t>(time_ns), cdr);
  ++result_.topics[topic];
  ++result_.recorded;
}

void RecordingFile::flush() { writer_.flush(); }

void RecordingFile::fail(const std::string& fault) {
  result_.fault = fault;
  result_.recorded -= std::min(result_.recorded, writer_.unwritten());
}

void RecordingFile::finish(const char* name, const std::string& json) {
  if (failed()) return;
  writer_.attach(name, "application/json", json, attached_at());
  writer_.finish();
}

RecordingResult RecordingFile::result() const {
  RecordingResult result = result_;
  result.bytes = writer_.bytes();
  if (writer_.keeps_earlier()) result.fault = "the run sent no message, so the file still holds the earlier recording";
  return result;
}

Recording::Recording(const std::string& file, const RecordedRun& run, MessageMemory& memory)
    : memory_(memory), to_wall_ns_(wall_ns() - steady_ns()), file_(file, run) {}

Recording::~Recording() {
  ended_ = true;
  if (thread_.joinable()) thread_.join();
}

void Recording::divide(const std::string& part_file, const RecordedRun& run) {
  part_ = std::make_unique<RecordingFile>(part_file, run);
  own_ = part_.get();
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
    cpu_s_ = static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
}

void Recording::write_arrived(bool last) {
  try {
    memory_.take(arrived_, last);
    std::ranges::stable_sort(arrived_, {}, &KeptMessage::time_ns);
    for (const KeptMessage& message : arrived_) {
      if (own_->failed()) break;  // the rings are emptied all the same: no program waits
      own_->write(topic_name(message.topic, message.user), message.number, message.time_ns + to_wall_ns_, message.cdr);
    }
    if (last && !own_->failed()) own_->flush();
  } catch (const std::exception& fault) {
    own_->fail(fault.what());
  }
  arrived_.clear();
}

RecordingResult Recording::drain(const std::vector<RecordingPart>& others) {
  ended_ = true;
  if (thread_.joinable()) thread_.join();
  const RecordingResult own = figures();
  if (!part_) return own;
  part_->finish(kPartAttachment, json_text(own));
  std::vector<RecordingPart> parts = others;
  parts.push_back({.host = "(this one)", .file = own.file});
  RecordingResult sum;
  try {
    sum = merge(parts, file_);
    file_.flush();
  } catch (const std::exception& fault) {
    file_.fail(fault.what());
  }
  RecordingResult all = file_.result();
  if (all.fault.empty()) all.fault = sum.fault;
  // What a part that is missing would hold is not known.
  all.sent = std::max(sum.sent, all.recorded + (all.fault.empty() ? 0 : 1));
  all.cpu_s = sum.cpu_s;
  return all;
}

RecordingResult Recording::figures() const {
  RecordingResult own = own_->result();
  own.sent = memory_.sent();
  own.cpu_s = cpu_s_;
  return own;
}

void Recording::finish(const std::string& summary_file) {
  if (!file_.failed()) file_.finish(kSummaryAttachment, text_of(summary_file));
}

void Recording::finish_part() { file_.finish(kPartAttachment, json_text(figures())); }

}  // namespace subworld
