#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

namespace subworld {

/// What an option sets. A vector takes a list, separated by commas; as a positional argument also by spaces.
using OptionTarget =
    std::variant<std::string*, std::optional<std::string>*, double*, std::optional<double>*, int*, std::optional<int>*,
                 std::uint64_t*, std::vector<std::string>*, std::vector<int>*, std::vector<double>*>;

/// An option of a `CommandLine`, for its checks. Every check names the option, the value and the cure. Numbers must be
/// finite.
class Option {
 public:
  struct Data;
  explicit Option(std::shared_ptr<Data> data) : data_(std::move(data)) {}

  /// Both ends belong to it; a value outside is refused with the likely slip of its unit ("s", "m", ...).
  Option& range(double least, double most, const std::string& unit = "");
  /// Shows the unit of a value whose range is checked elsewhere.
  Option& unit(const std::string& unit);
  Option& one_of(const std::vector<std::string>& words);
  /// `fault` gives what is wrong with a text, and the cure; empty: nothing.
  Option& check(std::function<std::string(const std::string&)> fault);
  /// The default, in words, where the target does not hold it.
  Option& otherwise(const std::string& text);
  Option& required();
  /// Also set by this environment variable.
  Option& environment(const std::string& name);
  /// Refused without the other one.
  Option& needs(const Option& other);
  /// The value is optional; this one is the default.
  Option& implies(const std::string& value);
  /// Not in the help.
  Option& hidden();

  [[nodiscard]] bool given() const;

 private:
  std::shared_ptr<Data> data_;
};

/// A command line: options, flags, positional arguments and commands with their own. All know --help and --version.
class CommandLine {
 public:
  CommandLine(const std::string& name, const std::string& about);
  ~CommandLine();
  CommandLine(const CommandLine&) = delete;
  CommandLine& operator=(const CommandLine&) = delete;

  /// An option ("--mode") or a positional argument ("scene"). The target keeps its value where it is not given; that
  /// value is shown as the default. Of several values of an option the last one counts; lists grow.
  Option add(const std::string& name, OptionTarget target, const std::string& what);
  Option flag(const std::string& name, bool& target, const std::string& what);
  /// Below the options, in the help.
  void footer(const std::string& text);
  /// Lines that --version adds.
  void version(const std::function<std::string()>& more);

  /// A command of this one; one of them must be chosen. The object lives as long as this one.
  CommandLine& command(const std::string& name, const std::string& about);
  [[nodiscard]] bool chosen() const;
  /// Takes any words.
  void takes_all();

  /// Reads a command line. The exit code where only help or the version was wanted. Throws `Error` (usage) for a wrong
  /// one; an unknown option or command is named with the nearest known one.
  [[nodiscard]] std::optional<int> parse(int argc, const char* const* argv);

 private:
  struct Impl;
  explicit CommandLine(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace subworld
