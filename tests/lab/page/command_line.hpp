#pragma once

#include "io/command_line.hpp"
#include "lab/page/tables.hpp"

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <vector>

/// The common part of the labs' command lines.
namespace subworld {

/// The files of these names. Throws `Error` (usage) where there is no scenes folder.
[[nodiscard]] std::vector<std::string> scene_files(const std::vector<std::string>& names);

/// --seed of random scenes.
Option add_seed(CommandLine& line, std::uint64_t& seed);
void add_out(CommandLine& line, const std::string& lab, std::string& out);
/// --duration, of which the scene has the default.
Option add_duration(CommandLine& line, std::optional<double>& duration_s);
/// out/lab_NAME-TIME
[[nodiscard]] std::string default_out(const std::string& lab);

/// Lab, date, points, machine: the beginning of a summary.
[[nodiscard]] Json begin_summary(const std::string& lab, std::size_t points, std::size_t planned);
/// "; stopped after 3 of 9 points", or nothing.
[[nodiscard]] std::string stopped_text(std::size_t points, std::size_t planned);
/// Writes results.json, results.csv, summary.json and the report, which gets its file; prints the verdict and their
/// paths. Returns the exit code. Throws `Error` (failed).
int end_lab(const std::string& out, const Rows& rows, const Json& summary,
            const std::function<void(const std::string&)>& report);

/// "  about 12 s left", or nothing where none is left.
[[nodiscard]] std::string left_text(double left_s);

/// How long the rest may take.
class TimeLeft {
 public:
  explicit TimeLeft(double work) : work_(work) {}
  /// In words, when so much of the work is done.
  [[nodiscard]] std::string text(double done) const;

 private:
  using Clock = std::chrono::steady_clock;
  double work_;
  Clock::time_point begin_ = Clock::now();
};

}  // namespace subworld
