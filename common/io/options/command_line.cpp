#include "io/options/command_line.hpp"

#include "io/options/manual.hpp"
#include "io/version.hpp"
#include "model/error.hpp"
#include "model/joined.hpp"
#include "model/shapes/nearest.hpp"
#include "model/slips.hpp"

#include <fmt/core.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <sstream>
#include <string_view>
#include <type_traits>

namespace subworld {

namespace {

constexpr std::size_t kHelpWidth = 72;  ///< characters of a description's line
constexpr const char* kHelp = "print this help and exit";

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
template <class T>
constexpr bool kIsText = std::is_same_v<ContentOf<T>, std::string>;

std::string with_unit(const std::string& text, const std::string& unit) {
  return unit.empty() || unit == kPartUnit ? text : text + " " + unit;
}

/// Large round numbers in digits.
std::string plain(double value) { return fmt::format("{:.9g}", value); }

std::string did_you_mean(std::string_view near) { return near.empty() ? "" : fmt::format("; did you mean {}?", near); }

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> items;
  std::istringstream stream(text);
  for (std::string item; std::getline(stream, item, ',');)
    if (!item.empty()) items.push_back(item);
  return items;
}

}  // namespace

bool Option::Data::is_list() const {
  return std::visit([](auto* into) { return kIsList<std::remove_pointer_t<decltype(into)>>; }, target);
}

std::vector<std::string> Option::as_given() const {
  if (!given()) return {};
  return {data_->name, data_->is_list() ? joined(data_->given, ",") : data_->given.back()};
}

namespace {

[[noreturn]] void refuse(const Option::Data& data, const std::string& value, const std::string& why) {
  const char* const set = data.variable.empty() ? nullptr : std::getenv(data.variable.c_str());
  const bool from_environment = set != nullptr && value == set && data.option->count() <= 1;
  throw Fault{fmt::format("{}{} {}: {}", data.name, from_environment ? fmt::format(" (or {})", data.variable) : "",
                          value, why)};
}

void convert(const Option::Data&, const std::string& text, std::string& value) { value = text; }

template <class Number>
void convert(const Option::Data& data, const std::string& text, Number& value) {
  const char* const begin = text.c_str() + (text.starts_with('+') ? 1 : 0);
  const char* const end = text.c_str() + text.size();
  double number = 0.0;
  const auto [rest, error] = std::from_chars(begin, end, number);
  if constexpr (std::is_integral_v<Number>) {
    if (error != std::errc{} || rest != end || number != std::floor(number))
      refuse(data, text, "must be a whole number");
  } else {
    if (error == std::errc::result_out_of_range || (error == std::errc{} && !std::isfinite(number)))
      refuse(data, text, "must be a finite number");
    if (error == std::errc{} && rest != end && std::isalpha(static_cast<unsigned char>(*rest)) != 0)
      refuse(data, text,
             data.unit.empty() || data.unit == kPartUnit
                 ? "must be a number without a unit"
                 : fmt::format("must be a number without its unit, which is {}", data.unit));
    if (error != std::errc{} || rest != end) refuse(data, text, "must be a number, such as 0.5 or 1e-4");
  }
  if (!data.limits.contains(number)) {
    refuse(data, text,
           fmt::format("out of range {} to {}{}", plain(data.limits.least),
                       with_unit(plain(data.limits.most), data.unit), likely_slip(number, data.limits, data.unit)));
  }
  const auto [last, wrong] = std::from_chars(begin, end, value);
  if (wrong != std::errc{} || last != end) refuse(data, text, "must be a whole number in digits, and not too large");
}

void check_word(const Option::Data& data, const std::string& word) {
  if (!data.words.empty() && std::ranges::find(data.words, word) == data.words.end()) {
    const std::string_view near = nearest(word, {data.words.begin(), data.words.end()});
    refuse(data, word, fmt::format("choose one of {}{}", joined(data.words, ", "), did_you_mean(near)));
  }
  if (!data.fault) return;
  if (const std::string why = data.fault(word); !why.empty()) refuse(data, word, why);
}

/// Writes the values, as given, to the target. Throws `Fault`.
void assign(Option::Data& data, const std::vector<std::string>& given) {
  data.given = given;
  std::visit(
      [&](auto* const into) {
        using T = std::remove_pointer_t<decltype(into)>;
        if constexpr (kIsList<T>) into->clear();
        for (const std::string& text : given) {
          if (text.starts_with("--")) throw Fault{fmt::format("{} needs a value, before {}", data.name, text)};
          for (const std::string& item : kIsList<T> && !data.whole ? split(text) : std::vector<std::string>{text}) {
            check_word(data, item);
            ContentOf<T> value{};
            convert(data, item, value);
            if constexpr (kIsList<T>) {
              into->push_back(value);
            } else {
              *into = value;
            }
          }
        }
      },
      data.target);
}

/// For the help, as the next one.
std::string value_name(const Option::Data& data) {
  if (!data.words.empty()) return fmt::format("{{{}}}", joined(data.words, ","));
  if (data.positional()) return data.required ? "" : "(optional)";
  return std::visit(
      [&](auto* const into) -> std::string {
        using T = std::remove_pointer_t<decltype(into)>;
        const bool text = kIsText<T> && !std::isfinite(data.limits.most);
        const std::string one = text ? "TEXT" : data.unit.empty() || data.unit == kPartUnit ? "N" : data.unit;
        return fmt::format("<{}>{}", one, kIsList<T> && !data.whole ? ",..." : "");
      },
      data.target);
}

std::string description(const Option::Data& data) {
  std::vector<std::string> facts;
  if (std::isfinite(data.limits.least) && std::isfinite(data.limits.most))
    facts.push_back(fmt::format("{} to {}", plain(data.limits.least), with_unit(plain(data.limits.most), data.unit)));
  if (!data.preset.empty() && !data.required) facts.push_back("default: " + data.preset);
  if (!data.variable.empty()) facts.push_back("environment: " + data.variable);
  if (data.needed) facts.push_back("needs " + data.needed->name);
  return folded(facts.empty() ? data.what : fmt::format("{} ({})", data.what, joined(facts, "; ")), kHelpWidth);
}

/// The default that the target holds, in words; empty: it holds none.
std::string held(const Option::Data& data) {
  return std::visit(
      [&](auto* const into) {
        using T = std::remove_pointer_t<decltype(into)>;
        std::string text;
        if constexpr (kIsList<T>) {
          text = joined(*into, ",");
        } else if constexpr (std::is_same_v<T, ContentOf<T>>) {
          text = fmt::format(fmt::runtime(std::is_same_v<T, double> ? "{:g}" : "{}"), *into);
        }
        return text.empty() || kIsText<T> ? text : with_unit(text, data.unit);
      },
      data.target);
}

}  // namespace

struct CommandLine::Impl {
  std::unique_ptr<CLI::App> owned;
  CLI::App* app = nullptr;
  std::vector<std::shared_ptr<Option::Data>> options;
  std::vector<std::unique_ptr<CommandLine>> commands;
  std::function<std::string()> more;

  /// Passes on to CLI11 what was said of the options since they were added.
  void prepare() const {
    for (const auto& data : options) {
      CLI::Option& option = *data->option;
      option.required(data->required)->envname(data->variable);
      if (data->needed) option.needs(data->needed->option);
      if (!data->implied.empty()) option.expected(0, 1)->default_str(data->implied);
      if (data->hidden) option.group("");
      if (data->what.empty()) continue;  // a flag, or hidden
      if (data->preset.empty()) data->preset = held(*data);
      option.option_text(value_name(*data) + (data->required && !data->positional() ? " (required)" : ""));
      option.description(description(*data));
    }
    for (const auto& command : commands) command->impl_->prepare();
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
    if (argc < 2) throw Fault{fmt::format("a command is missing; choose one of: {}", joined(known, ", "))};
    throw Fault{fmt::format("\"{}\" is no command; choose one of: {}{}", argv[1], joined(known, ", "),
                            did_you_mean(nearest(argv[1], known)))};
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
  impl_->app->set_help_flag("-h,--help", kHelp);
}

CommandLine::~CommandLine() = default;

Option CommandLine::add(const std::string& name, OptionTarget target, const std::string& what) {
  auto data = std::make_shared<Option::Data>();
  data->target = target;
  data->name = name;
  data->what = what;
  // CLI11 2.4 takes -h and --h for the same name.
  if (name == "--h") impl_->app->set_help_flag("--help", kHelp);
  data->option = impl_->app->add_option(name, [data = data.get()](const CLI::results_t& given) {
    assign(*data, given);
    return true;
  });
  const bool list = data->is_list();
  data->option->multi_option_policy(list ? CLI::MultiOptionPolicy::TakeAll : CLI::MultiOptionPolicy::TakeLast);
  if (list && data->positional()) data->option->expected(-1);
  impl_->options.push_back(data);
  return Option(data);
}

Option CommandLine::flag(const std::string& name, bool& target, const std::string& what) {
  auto data = std::make_shared<Option::Data>();
  data->name = name;
  data->option = impl_->app->add_flag(name, target, folded(what, kHelpWidth));
  impl_->options.push_back(data);
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

bool is_option(std::string_view word) {
  return word.size() > 1 && word.front() == '-' && std::isdigit(static_cast<unsigned char>(word[1])) == 0;
}

/// "unknown option --duraton; did you mean --duration?", or `otherwise` where every option is known.
std::string fault_of(const CLI::App& command, const std::string& otherwise) {
  for (const std::string& word : command.remaining()) {
    if (!is_option(word)) continue;
    const std::string option = word.substr(0, word.find('='));
    std::vector<std::string_view> names;
    for (const CLI::Option* known : command.get_options()) {
      if (known->get_group().empty()) continue;  // hidden
      for (const std::string& name : known->get_lnames()) names.push_back(name);
    }
    const std::string_view near = nearest(option.substr(option.find_first_not_of('-')), names);
    return fmt::format("unknown option {}{}", option, did_you_mean(near.empty() ? "" : fmt::format("--{}", near)));
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
  impl_->prepare();
  if (const std::string text = argc == 2 ? manual(app, argv[1]) : ""; !text.empty()) {
    fmt::print("{}", text);
    return 0;
  }
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
