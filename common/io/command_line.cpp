#include "io/command_line.hpp"

#include "io/version.hpp"
#include "model/error.hpp"
#include "model/nearest.hpp"
#include "model/slips.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>

#include <cctype>
#include <charconv>
#include <cmath>
#include <sstream>
#include <string_view>
#include <type_traits>

namespace subworld {

namespace {

constexpr std::size_t kHelpWidth = 72;  ///< characters of a description's line

/// A wrong command line, in words.
struct Fault {
  std::string text;
};

template <class T>
struct Content {
  using type = T;
};
template <class T>
struct Content<std::optional<T>> {
  using type = T;
};
template <class T>
struct Content<std::vector<T>> {
  using type = T;
};
/// What a target holds one or several of.
template <class T>
using ContentOf = typename Content<T>::type;
template <class T>
constexpr bool kIsList = std::is_same_v<T, std::vector<ContentOf<T>>>;

/// In lines of at most kHelpWidth characters.
std::string folded(const std::string& text) {
  std::istringstream words(text);
  std::string lines;
  std::size_t width = 0;
  for (std::string word; words >> word; width += word.size() + 1) {
    const bool next_line = width + word.size() > kHelpWidth;
    if (next_line) width = 0;
    lines += (lines.empty() ? "" : next_line ? "\n" : " ") + word;
  }
  return lines;
}

std::string with_unit(const std::string& text, const std::string& unit) {
  return unit.empty() || unit == kPartUnit ? text : text + " " + unit;
}

/// Large round numbers in digits.
std::string plain(double value) { return fmt::format("{:.9g}", value); }

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> items;
  std::istringstream stream(text);
  for (std::string item; std::getline(stream, item, ',');) {
    if (!item.empty()) items.push_back(item);
  }
  return items;
}

}  // namespace

struct Option::Data {
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
  std::string other;  ///< name of an option that it needs
  bool positional = false;
  bool required = false;

  /// Writes the values, as given, to the target. Throws `Fault`.
  void assign(const std::vector<std::string>& given) const;
  /// For the help.
  [[nodiscard]] std::string placeholder() const;
  [[nodiscard]] std::string description() const;

 private:
  [[noreturn]] void refuse(const std::string& value, const std::string& why) const;
  void check_range(double value, const std::string& text) const;
  void convert(const std::string& text, std::string& value) const { value = text; }
  void convert(const std::string& text, double& value) const;
  template <class Integer>
  void convert(const std::string& text, Integer& value) const;
};

void Option::Data::refuse(const std::string& value, const std::string& why) const {
  const char* const set = variable.empty() ? nullptr : std::getenv(variable.c_str());
  const bool from_environment = set != nullptr && value == set && option->count() <= 1;
  throw Fault{fmt::format("{}{} {}: {}", name, from_environment ? fmt::format(" (or {})", variable) : "", value, why)};
}

void Option::Data::check_range(double value, const std::string& text) const {
  if (limits.contains(value)) return;
  refuse(text, fmt::format("out of range {} to {}{}", plain(limits.least), with_unit(plain(limits.most), unit),
                           likely_slip(value, limits, unit)));
}

void Option::Data::convert(const std::string& text, double& value) const {
  const char* const begin = text.c_str() + (text.starts_with('+') ? 1 : 0);
  const char* const end = text.c_str() + text.size();
  const auto [rest, error] = std::from_chars(begin, end, value);
  if (error == std::errc::result_out_of_range || (error == std::errc{} && !std::isfinite(value)))
    refuse(text, "must be a finite number");
  if (error == std::errc{} && rest != end && std::isalpha(static_cast<unsigned char>(*rest)) != 0)
    refuse(text, unit.empty() || unit == kPartUnit
                     ? "must be a number without a unit"
                     : fmt::format("must be a number without its unit, which is {}", unit));
  if (error != std::errc{} || rest != end) refuse(text, "must be a number, such as 0.5 or 1e-4");
  check_range(value, text);
}

template <class Integer>
void Option::Data::convert(const std::string& text, Integer& value) const {
  const char* const begin = text.c_str() + (text.starts_with('+') ? 1 : 0);
  const char* const end = text.c_str() + text.size();
  const auto [rest, error] = std::from_chars(begin, end, value);
  double number = 0.0;
  const auto [after, wrong] = std::from_chars(begin, end, number);
  if (wrong != std::errc{} || after != end || number != std::floor(number)) refuse(text, "must be a whole number");
  check_range(number, text);
  if (error != std::errc{} || rest != end) refuse(text, "must be a whole number in digits, and not too large");
}

void Option::Data::assign(const std::vector<std::string>& given) const {
  std::visit(
      [&](auto* const into) {
        using T = std::remove_pointer_t<decltype(into)>;
        if constexpr (kIsList<T>) into->clear();
        for (const std::string& text : given) {
          if (text.starts_with("--")) throw Fault{fmt::format("{} needs a value, before {}", name, text)};
          for (const std::string& item : kIsList<T> ? split(text) : std::vector<std::string>{text}) {
            if (!words.empty() && std::ranges::find(words, item) == words.end()) {
              const std::string_view near = nearest(item, {words.begin(), words.end()});
              refuse(item, fmt::format("choose one of {}{}", fmt::join(words, ", "),
                                       near.empty() ? "" : fmt::format("; did you mean {}?", near)));
            }
            if (fault) {
              if (const std::string why = fault(item); !why.empty()) refuse(item, why);
            }
            ContentOf<T> value{};
            convert(item, value);
            if constexpr (kIsList<T>) {
              into->push_back(value);
            } else {
              *into = value;
            }
          }
        }
      },
      target);
}

std::string Option::Data::placeholder() const {
  if (positional && words.empty()) return required ? "" : "(optional)";
  if (!words.empty()) return fmt::format("{{{}}}", fmt::join(words, ","));
  return std::visit(
      [&](auto* const into) -> std::string {
        using T = std::remove_pointer_t<decltype(into)>;
        const std::string one = std::is_same_v<ContentOf<T>, std::string> ? "TEXT"
                                : unit.empty() || unit == kPartUnit       ? "N"
                                                                          : unit;
        return fmt::format("<{}>{}", one, kIsList<T> ? ",..." : "");
      },
      target);
}

std::string Option::Data::description() const {
  std::vector<std::string> facts;
  if (std::isfinite(limits.least) && std::isfinite(limits.most))
    facts.push_back(fmt::format("{} to {}", plain(limits.least), with_unit(plain(limits.most), unit)));
  if (!preset.empty()) facts.push_back("default: " + preset);
  if (!variable.empty()) facts.push_back("environment: " + variable);
  if (!other.empty()) facts.push_back("needs " + other);
  return folded(facts.empty() ? what : fmt::format("{} ({})", what, fmt::join(facts, "; ")));
}

Option& Option::range(double least, double most, const std::string& unit) {
  data_->limits = {.least = least, .most = most};
  return this->unit(unit);
}

Option& Option::unit(const std::string& unit) {
  const bool number = std::visit(
      [](auto* into) { return !std::is_same_v<ContentOf<std::remove_pointer_t<decltype(into)>>, std::string>; },
      data_->target);
  if (!data_->preset.empty() && number) data_->preset = with_unit(data_->preset, unit);
  data_->unit = unit;
  return *this;
}

Option& Option::one_of(const std::vector<std::string>& words) {
  data_->words = words;
  return *this;
}

Option& Option::check(std::function<std::string(const std::string&)> fault) {
  data_->fault = std::move(fault);
  return *this;
}

Option& Option::otherwise(const std::string& text) {
  data_->preset = text;
  return *this;
}

Option& Option::required() {
  data_->required = true;
  data_->preset.clear();
  data_->option->required();
  return *this;
}

Option& Option::environment(const std::string& name) {
  data_->variable = name;
  data_->option->envname(name);
  return *this;
}

Option& Option::needs(const Option& other) {
  data_->other = other.data_->name;
  data_->option->needs(other.data_->option);
  return *this;
}

Option& Option::implies(const std::string& value) {
  data_->option->expected(0, 1)->default_str(value);
  return *this;
}

Option& Option::hidden() {
  data_->option->group("");
  return *this;
}

bool Option::given() const { return data_->option->count() > 0; }

struct CommandLine::Impl {
  std::unique_ptr<CLI::App> owned;
  CLI::App* app = nullptr;
  std::vector<std::shared_ptr<Option::Data>> options;
  std::vector<std::unique_ptr<CommandLine>> commands;
  std::function<std::string()> more;

  /// Options of this command's help.
  void describe() const {
    for (const auto& data : options) {
      data->option->option_text(data->placeholder() + (data->required && !data->positional ? " (required)" : ""));
      data->option->description(data->description());
    }
    for (const auto& command : commands) command->impl_->describe();
  }
  /// Throws `Fault` where the first word is meant as a command and is none: CLI11 would not name it.
  void check_command(int argc, const char* const* argv) const {
    if (commands.empty() || (argc > 1 && *argv[1] == '-')) return;
    std::vector<std::string_view> known;
    for (const auto& command : commands) {
      const std::string& name = command->impl_->app->get_name();
      if (argc > 1 && name == argv[1]) return command->impl_->check_command(argc - 1, argv + 1);
      known.push_back(name);
    }
    if (argc < 2) throw Fault{fmt::format("a command is missing; choose one of: {}", fmt::join(known, ", "))};
    const std::string_view near = nearest(argv[1], known);
    throw Fault{fmt::format("\"{}\" is no command; choose one of: {}{}", argv[1], fmt::join(known, ", "),
                            near.empty() ? "" : fmt::format("; did you mean {}?", near))};
  }
};

CommandLine::CommandLine(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

CommandLine::CommandLine(const std::string& name, const std::string& about) : impl_(std::make_unique<Impl>()) {
  impl_->owned = std::make_unique<CLI::App>(about, name);
  impl_->app = impl_->owned.get();
  impl_->app->set_version_flag(
      "--version",
      [this, program = name.substr(0, name.find(' '))] {
        const std::string more = impl_->more ? impl_->more() : "";
        return fmt::format("{} {}{}{}", program, version_text(), more.empty() ? "" : "\n", more);
      },
      "print the version and exit");
  impl_->app->set_help_flag("-h,--help", "print this help and exit");
}

CommandLine::~CommandLine() = default;

Option CommandLine::add(const std::string& name, OptionTarget target, const std::string& what) {
  auto data = std::make_shared<Option::Data>();
  data->target = target;
  data->name = name;
  data->what = what;
  data->positional = !name.starts_with('-');
  data->option = impl_->app->add_option(name, [data = data.get()](const CLI::results_t& given) {
    data->assign(given);
    return true;
  });
  data->option->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
  std::visit(
      [&](auto* const into) {
        using T = std::remove_pointer_t<decltype(into)>;
        if constexpr (kIsList<T>) {
          data->option->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
          if (data->positional) data->option->expected(-1);
          data->preset = fmt::format("{}", fmt::join(*into, ","));
        } else if constexpr (std::is_same_v<T, double>) {
          data->preset = fmt::format("{:g}", *into);
        } else if constexpr (std::is_same_v<T, ContentOf<T>>) {
          data->preset = fmt::format("{}", *into);
        }
      },
      target);
  impl_->options.push_back(data);
  return Option(data);
}

Option CommandLine::flag(const std::string& name, bool& target, const std::string& what) {
  auto data = std::make_shared<Option::Data>();
  data->name = name;
  data->option = impl_->app->add_flag(name, target, folded(what));
  return Option(data);
}

void CommandLine::footer(const std::string& text) { impl_->app->footer(text); }

void CommandLine::version(const std::function<std::string()>& more) { impl_->more = more; }

CommandLine& CommandLine::command(const std::string& name, const std::string& about) {
  auto impl = std::make_unique<Impl>();
  impl->app = impl_->app->add_subcommand(name, about);
  impl_->app->require_subcommand(1);
  impl_->commands.push_back(std::unique_ptr<CommandLine>(new CommandLine(std::move(impl))));
  return *impl_->commands.back();
}

bool CommandLine::chosen() const { return impl_->app->parsed(); }

void CommandLine::takes_all() { impl_->app->prefix_command()->set_help_flag(); }

namespace {

/// The names of a command's options, without their dashes and without hidden ones.
std::vector<std::string_view> option_names(const CLI::App& command) {
  std::vector<std::string_view> names;
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_group().empty()) continue;
    for (const std::string& name : option->get_lnames()) names.push_back(name);
  }
  return names;
}

bool is_option(std::string_view word) {
  return word.size() > 1 && word.front() == '-' && std::isdigit(static_cast<unsigned char>(word[1])) == 0;
}

/// "unknown option --duraton; did you mean --duration?", or `otherwise` where every option is known.
std::string fault_of(const CLI::App& command, const std::string& otherwise) {
  for (const std::string& word : command.remaining()) {
    if (!is_option(word)) continue;
    const std::string option = word.substr(0, word.find('='));
    const std::string_view near = nearest(option.substr(option.find_first_not_of('-')), option_names(command));
    return fmt::format("unknown option {}{}", option, near.empty() ? "" : fmt::format("; did you mean --{}?", near));
  }
  return otherwise;
}

[[noreturn]] void refuse(const CLI::App& app, const std::function<std::string(const CLI::App&)>& fault_in) {
  const CLI::App* command = &app;
  std::string name = app.get_name();
  while (!command->get_subcommands().empty()) {
    command = command->get_subcommands().front();
    name += " " + command->get_name();
  }
  const std::string fault = fault_in(*command);
  throw Error(ExitCode::usage, fmt::format("{}{} {} --help", fault, fault.ends_with('?') ? " See" : "; see", name));
}

}  // namespace

std::optional<int> CommandLine::parse(int argc, const char* const* argv) {
  CLI::App& app = *impl_->app;
  impl_->describe();
  try {
    impl_->check_command(argc, argv);
    app.parse(argc, argv);
  } catch (const CLI::Success& done) {
    return app.exit(done);
  } catch (const Fault& fault) {
    refuse(app, [&](const CLI::App&) { return fault.text; });
  } catch (const CLI::ParseError& wrong) {
    refuse(app, [&](const CLI::App& command) { return fault_of(command, wrong.what()); });
  }
  return std::nullopt;
}

}  // namespace subworld
