#include "wire/last_messages.hpp"

#include "wire/codec/cdr.hpp"
#include "wire/topics.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <initializer_list>
#include <optional>
#include <string_view>

namespace subworld {

namespace {

/// The archive that reads a message and picks its main figures, as far as its bytes go. A message refers to others
/// that may be gone (wire/changes): its lists are not restored.
class Figures {
 public:
  Figures(CdrReader& reader, std::size_t topic) : changes(reader.changes), reader_(reader), topic_(topic) {}

  Changes& changes;
  std::uint64_t user = 0, number = 0;
  std::optional<double> stamp_s;
  std::optional<Vec3> position_m, force_n;
  std::string state;

  bool operator()(const char* field, auto&& value) {
    if (!reader_(field, value)) return false;
    pick(field, value);
    return true;
  }
  bool operator()(const char* field, const auto& value, auto& sent) { return reader_(field, value, sent); }
  bool sequence(const char* field, auto& all, auto read) { return reader_.sequence(field, all, read); }
  bool check(bool) { return true; }

 private:
  void pick(std::string_view field, const auto& value) {
    using T = std::remove_cvref_t<decltype(value)>;
    const auto is = [&](std::initializer_list<std::string_view> names) {
      return std::ranges::find(names, field) != names.end();
    };
    if constexpr (requires { name_of(value); }) {
      state = name_of(value);
    } else if constexpr (std::is_integral_v<T> || std::is_enum_v<T>) {
      const auto one = static_cast<std::uint64_t>(value);
      if (is({"user", "device", "instance"})) user = one;
      if (is({"number", "sequence_number", "stamp", "steps"})) number = one;
      if (field == "served" && one == 0 && topic_ == kTopicIndex<WorldFrame>) state = "complete";
      if (field == "last" && one != 0) state = "last";
    } else if constexpr (std::is_floating_point_v<T>) {
      if (is({"stamp_s", "time_s"})) stamp_s = value;
    } else if constexpr (std::same_as<T, std::string>) {
      if (is({"name", "state"})) state = value;
    } else if constexpr (std::same_as<T, Pose> || std::same_as<T, BodyState>) {
      position_m = value.position;
    } else if constexpr (std::same_as<T, Wrench>) {
      if (is({"applied", "wrench"})) force_n = value.force;
    }
  }

  CdrReader& reader_;
  std::size_t topic_;
};

template <class Model>
void read_figures(Figures& archive) {
  Model sample;
  (void)fields(archive, sample);
}
constexpr std::array kReadFigures = std::apply(
    []<class... Models>(const Topic<Models>&...) { return std::array{&read_figures<Models>...}; }, kTopicTable);

std::string cell(std::optional<double> value) { return value ? fmt::format(",{:.9g}", *value) : ","; }
std::string cells(const std::optional<Vec3>& v) { return v ? cell(v->x()) + cell(v->y()) + cell(v->z()) : ",,,"; }

std::string line_of(const KeptMessage& message) {
  constexpr std::size_t kLongestState = 13;
  Changes changes;
  CdrReader reader(message.cdr, changes);
  Figures figures(reader, message.topic);
  if (reader.is_plain()) kReadFigures[message.topic](figures);
  return fmt::format("{:.6f},{},{},{},{}{},{}{}{},{},{}\n", 1e-9 * static_cast<double>(message.time_ns),
                     message.sent ? "sent" : "received", kTopics[message.topic].name, figures.user, figures.number,
                     cell(figures.stamp_s), message.bytes, cells(figures.position_m), cells(figures.force_n),
                     message.bodies == kNoBodies ? "" : std::to_string(message.bodies),
                     figures.state.substr(0, kLongestState));
}

}  // namespace

std::string write_last_messages(std::vector<KeptMessage> messages, const std::string& path) {
  if (messages.empty()) return {};
  // Several threads send: who has taken a place first may have read the clock later.
  std::ranges::stable_sort(messages, {}, &KeptMessage::time_ns);
  std::ofstream file(path);
  file << "time_s,direction,topic,user,number,stamp_s,bytes,x_m,y_m,z_m,force_x_n,force_y_n,force_z_n,bodies,state\n";
  for (const KeptMessage& message : messages) file << line_of(message);
  file.close();
  if (file) return {};
  const std::string fault = fmt::format("{}: {}", path, std::strerror(errno));
  std::remove(path.c_str());
  return fault;
}

void write_last_messages(const std::string& path) noexcept {
  try {
    if (const std::string fault = write_last_messages(own_messages(), path); !fault.empty())
      fmt::print(stderr, "warning: {}\n", fault);
  } catch (const std::exception& wrong) {
    fmt::print(stderr, "warning: {}: {}\n", path, wrong.what());
  }
}

}  // namespace subworld
