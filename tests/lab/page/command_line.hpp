#pragma once

#include "io/options/command_line.hpp"
#include "lab/page/tables.hpp"

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <vector>

/// Common part of the labs' command lines.
namespace subworld {

/// The files of these scenes. Throws `Error` (usage) if there is no scenes folder.
[[nodiscard]] std::vector<std::string> scene_files(const std::vector<std::string>& names);

/// --seed, of random scenes if nothing else is said.
Option add_seed(CommandLine& line, std::uint64_t& seed, const std::string& what = "seed of the random scenes");
void add_out(CommandLine& line, const std::string& lab, std::string& out);
/// --duration, of which the scene has the default.
Option add_duration(CommandLine& line, std::optional<double>& duration_s);
/// out/lab_NAME-TIME
[[nodiscard]] std::string default_out(const std::string& lab);

/// Makes the folder of the results, and names the lab in its summary.json if there is none. Throws `Error` (usage)
/// where the lab would replace a file that no program of ours has made, before it replaces any.
void open_results(const std::string& lab, const std::string& out);

/// Beginning of a summary: lab, date, points, machine.
[[nodiscard]] Json begin_summary(const std::string& lab, std::size_t points, std::size_t planned);
/// "; stopped after 3 of 9 points", or empty.
[[nodiscard]] std::string stopped_text(std::size_t points, std::size_t planned);
/// Writes summary.json, the report (`report` gets its file name) and, where there are rows, results.json and
/// results.csv; prints the verdict and the table's name, without rows that of `other_table`. Returns the exit code.
/// Throws `Error` (failed).
int end_lab(const std::string& out, const Rows& rows, const Json& summary,
            const std::function<void(const std::string&)>& report, const std::string& other_table = "");

/// For `subworld report DIR` on the folder of a lab, which starts `lab_NAME --write-report DIR PAGE`: `write` gets
/// both. Returns the exit code; none where the words are others. Throws `Error` (failed) for tables of another version.
[[nodiscard]] std::optional<int> report_again(
    int argc, char** argv, const std::function<void(const std::string& folder, const std::string& page)>& write);

/// "about 12 s", "about 31 min".
[[nodiscard]] std::string about_text(double s);
/// "  about 12 s left", or empty if no time is left.
[[nodiscard]] std::string left_text(double left_s);

/// Estimates the remaining time.
class TimeLeft {
 public:
  explicit TimeLeft(double work) : work_(work) {}
  /// The estimate in words, when this share of the work is done.
  [[nodiscard]] std::string text(double done) const;

 private:
  using Clock = std::chrono::steady_clock;
  double work_;
  Clock::time_point begin_ = Clock::now();
};

}  // namespace subworld
