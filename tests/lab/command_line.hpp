#pragma once

#include "lab/tables.hpp"

#include <CLI/CLI.hpp>

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <vector>

/// Common part of the labs' command lines.
namespace subworld {

/// The files of these scenes. Throws `Error` (usage) if there is no scenes folder.
[[nodiscard]] std::vector<std::string> scene_files(const std::vector<std::string>& names);

/// Check for CLI11, whose range check accepts "nan".
[[nodiscard]] std::string not_finite(const std::string& text);
/// An option that takes a list, separated by commas.
template <class T>
CLI::Option* add_list(CLI::App& app, const char* flag, std::vector<T>& values, const std::string& what) {
  return app.add_option(flag, values, what)->delimiter(',')->allow_extra_args(false);
}
inline void add_numbers(CLI::App& app, const char* flag, std::vector<double>& values, const std::string& what,
                        double low, double high) {
  add_list(app, flag, values, what)->check(CLI::Range(low, high))->check(not_finite);
}
/// --seed of random scenes.
CLI::Option* add_seed(CLI::App& app, std::uint64_t& seed);
void add_out(CLI::App& app, const std::string& lab, std::string& out);
/// out/lab_NAME-TIME
[[nodiscard]] std::string default_out(const std::string& lab);

/// Beginning of a summary: lab, date, points, machine.
[[nodiscard]] Json begin_summary(const std::string& lab, std::size_t points, std::size_t planned);
/// "; stopped after 3 of 9 points", or empty.
[[nodiscard]] std::string stopped_text(std::size_t points, std::size_t planned);
/// Writes results.json, results.csv, summary.json and the report (`report` gets its file name); prints the verdict and
/// the folder. Returns the exit code. Throws `Error` (failed).
int end_lab(const std::string& out, const Rows& rows, const Json& summary,
            const std::function<void(const std::string&)>& report);

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
