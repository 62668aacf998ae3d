#pragma once

#include "model/slips.hpp"

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

namespace CLI {
class Option;
}

namespace subworld {

/// What an option sets. A vector takes a list, separated by commas; as a positional argument also by spaces.
using OptionTarget =
    std::variant<std::string*, std::optional<std::string>*, double*, std::optional<double>*, int*, std::optional<int>*,
                 std::uint64_t*, std::vector<std::string>*, std::vector<int>*, std::vector<double>*>;

/// An option of a `CommandLine`, for its checks. Every check names the option, the value and the cure. Numbers must be
/// finite.
class Option {
 public:
  struct Data {
    CLI::Option* option = nullptr;
    OptionTarget target;
    std::string name;  ///< as written, with its dashes
    std::string what;
    std::string preset;  ///< the default, in words
    std::string unit;
    Limits limits;
    std::vector<std::string> words;
    std::function<std::string(const std::string&)> fault;
    std::string variable;
    std::shared_ptr<Data> needed;
    std::string implied;
    bool required = false, hidden = false, whole = false;
    std::vector<std::string> given;  ///< the values, as written

    [[nodiscard]] bool positional() const { return !name.starts_with('-'); }
    [[nodiscard]] bool is_list() const;
  };
  explicit Option(std::shared_ptr<Data> data) : data_(std::move(data)) {}

  /// Both ends belong to it; a value outside is refused with the likely slip of its unit ("s", "m", ...).
  Option& range(double least, double most, const std::string& unit = "") {
    data_->limits = {.least = least, .most = most};
    return set(data_->unit, unit);
  }
  Option& one_of(const std::vector<std::string>& words) { return set(data_->words, words); }
  /// `fault` gives what is wrong with a text, and the cure; empty: nothing.
  Option& check(std::function<std::string(const std::string&)> fault) { return set(data_->fault, std::move(fault)); }
  /// The default, in words, where the target does not hold it.
  Option& otherwise(const std::string& text) { return set(data_->preset, text); }
  Option& required() { return set(data_->required, true); }
  /// Also set by this environment variable.
  Option& environment(const std::string& name) { return set(data_->variable, name); }
  /// Refused without the other one.
  Option& needs(const Option& other) { return set(data_->needed, other.data_); }
  /// The value is optional; this one is the default.
  Option& implies(const std::string& value) { return set(data_->implied, value); }
  /// Not in the help.
  Option& hidden() { return set(data_->hidden, true); }

  /// Of a list: a comma belongs to its value.
  Option& whole() { return set(data_->whole, true); }

  [[nodiscard]] bool given() const { return !data_->given.empty(); }
  /// The option and its value, as words of a command line; none where it is not given.
  [[nodiscard]] std::vector<std::string> as_given() const;

 private:
  template <class T>
  Option& set(T& what, T value) {
    what = std::move(value);
    return *this;
  }
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
