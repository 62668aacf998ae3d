#include "io/command_line.hpp"

#include "model/error.hpp"
#include "model/nearest.hpp"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <cctype>
#include <string>
#include <string_view>
#include <vector>

namespace subworld {

namespace {

/// The names of a command's options, without their dashes and those that its help does not show.
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

}  // namespace

std::optional<int> parse_arguments(CLI::App& app, int argc, const char* const* argv) {
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& done) {
    return app.exit(done);
  } catch (const CLI::ParseError& wrong) {
    const CLI::App* command = &app;
    std::string name = app.get_name();
    while (!command->get_subcommands().empty()) {
      command = command->get_subcommands().front();
      name += " " + command->get_name();
    }
    const std::string fault = fault_of(*command, wrong.what());
    throw Error(ExitCode::usage, fmt::format("{}{} {} --help", fault, fault.ends_with('?') ? " See" : "; see", name));
  }
  return std::nullopt;
}

}  // namespace subworld
