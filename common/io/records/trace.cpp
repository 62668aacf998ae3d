#include "io/records/trace.hpp"

#include "model/error.hpp"
#include "rt/cyclic.hpp"
#include "rt/wall_clock.hpp"

#include <fmt/core.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <utility>

namespace subworld {

namespace {

constexpr std::array kNames{"force_n", "members", "lateness_s", "real_time_factor", "missed deadline", "lost frames"};

/// A row holds: kind, name, begin in ns, and a duration in ns or a value.
enum class Kind : std::uint8_t { step, stage, counter, instant };
constexpr std::size_t kWidth = 4;

double ns(TimePoint t) noexcept { return static_cast<double>(to_ns(t)); }

void put_event(std::string& text, std::span<const double> row, int pid, const std::vector<std::string>& stages) {
  const auto kind = static_cast<Kind>(static_cast<int>(row[0]));
  const auto which = static_cast<std::size_t>(row[1]);
  const bool lasts = kind == Kind::step || kind == Kind::stage;
  text += fmt::format(",\n{{\"ph\":\"{}\",\"name\":\"{}\",\"pid\":{},\"tid\":1,\"ts\":{:.3f},",
                      lasts                   ? "X"
                      : kind == Kind::counter ? "C"
                                              : "i",
                      kind == Kind::step ? "step"
                      : lasts            ? stages[which]
                                         : kNames[which],
                      pid, 1e-3 * row[2]);
  if (lasts) {
    text += fmt::format("\"dur\":{:.3f}}}", 1e-3 * row[3]);
  } else if (kind == Kind::counter) {
    text += fmt::format("\"args\":{{\"value\":{:.6g}}}}}", row[3]);
  } else {
    text += "\"s\":\"p\"}";
  }
}

/// In the first lines of a trace.
constexpr std::string_view kWallClock = "\"wall_minus_steady_ns\":";

std::int64_t wall_minus_steady_ns() { return wall_ns() - to_ns(Clock::now()); }

void shift_time(std::string& event, std::int64_t shift_ns) {
  constexpr std::string_view kTime = "\"ts\":";
  const std::size_t at = event.find(kTime);
  if (at == std::string::npos) return;
  const std::size_t begin = at + kTime.size(), end = event.find_first_of(",}", begin);
  const double us = std::strtod(event.c_str() + begin, nullptr) + 1e-3 * static_cast<double>(shift_ns);
  event.replace(begin, end - begin, fmt::format("{:.3f}", us));
}

History::Format format_of(const TraceProgram& program, std::span<const char* const> stages) {
  const int pid = program.number;
  const std::vector<std::string> names(stages.begin(), stages.end());
  return {
      .width = kWidth,
      .head = fmt::format(
          "[\n{{\"ph\":\"M\",\"name\":\"process_name\",\"pid\":{0},\"tid\":1,\"args\":{{\"name\":\"{1}\"}}}},\n"
          "{{\"ph\":\"M\",\"name\":\"thread_name\",\"pid\":{0},\"tid\":1,\"args\":{{\"name\":\"loop\"}}}},\n"
          "{{\"ph\":\"M\",\"name\":\"process_sort_index\",\"pid\":{0},\"tid\":1,\"args\":{{\"sort_index\":{0}}}}},\n"
          "{{\"ph\":\"M\",\"name\":\"clock\",\"pid\":{0},\"tid\":1,\"args\":{{{2}{3}}}}}",
          pid, program.name, kWallClock, wall_minus_steady_ns()),
      .row = [pid, names](std::string& text, std::span<const double> row) { put_event(text, row, pid, names); },
      .tail = "\n]\n"};
}

}  // namespace

Trace::Trace(const std::string& path, const TraceProgram& program, std::span<const char* const> stages,
             History::Say say)
    : on_(!path.empty()), rows_(path, format_of(program, stages), std::move(say)) {}

void Trace::step(const StageStep& step) noexcept {
  if (!on_) return;
  const auto put = [&](Kind kind, std::size_t name, TimePoint begin, TimePoint end) {
    rows_.row({static_cast<double>(kind), static_cast<double>(name), ns(begin), ns(end) - ns(begin)});
  };
  put(Kind::step, 0, step.begin, step.end);
  for (const StageStretch& s : step.stretches) put(Kind::stage, s.stage, s.begin, s.end);
}

void Trace::counter(Name name, TimePoint at, double value) noexcept {
  if (on_) rows_.row({static_cast<double>(Kind::counter), static_cast<double>(name), ns(at), value});
}

void Trace::instant(Name name, TimePoint at) noexcept {
  if (on_) rows_.row({static_cast<double>(Kind::instant), static_cast<double>(name), ns(at), 0.0});
}

void merge_traces(const std::vector<TracePart>& parts, const std::string& path) {
  std::ofstream all(path);
  all << "[";
  bool first = true;
  for (const TracePart& part : parts) {
    std::ifstream file(part.file);
    std::int64_t shift_ns = 0;
    for (std::string line; std::getline(file, line);) {
      if (line.ends_with(',')) line.pop_back();
      if (!line.starts_with('{') || !line.ends_with('}')) continue;
      if (const std::size_t at = line.find(kWallClock); at != std::string::npos && part.ahead_s) {
        shift_ns = std::strtoll(line.c_str() + at + kWallClock.size(), nullptr, 10) - wall_minus_steady_ns() -
                   static_cast<std::int64_t>(1e9 * *part.ahead_s);
      }
      if (shift_ns != 0) shift_time(line, shift_ns);
      all << (first ? "\n" : ",\n") << line;
      first = false;
    }
  }
  all << "\n]\n";
  if (!all.flush()) {
    throw Error(ExitCode::failed, fmt::format("{}: {}; name another file with --trace", path, std::strerror(errno)));
  }
}

}  // namespace subworld
