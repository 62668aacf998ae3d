#pragma once

#include "lab/page/tables.hpp"

#include <CLI/CLI.hpp>

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <vector>

/// What the command lines of the labs have in common.
namespace subworld {

/// The files of these names. Throws `Error` (usage) where there is no scenes folder.
[[nodiscard]] std::vector<std::string> scene_files(const std::vector<std::string>& names);

/// For CLI11, whose range lets "nan" pass.
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

/// Lab, date, points, machine: the beginning of a summary.
[[nodiscard]] Json begin_summary(const std::string& lab, std::size_t points, std::size_t planned);
/// "; stopped after 3 of 9 points", or nothing.
[[nodiscard]] std::string stopped_text(std::size_t points, std::size_t planned);
/// Writes results.json, results.csv, summary.json and the report, which gets its file; prints the verdict and where
/// they are. Returns the exit code. Throws `Error` (failed).
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
