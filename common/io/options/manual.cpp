#include "io/options/manual.hpp"

#include "io/version.hpp"

#include <fmt/core.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cctype>
#include <sstream>
#include <vector>

namespace subworld {

std::string folded(const std::string& text, std::size_t width, const std::string& indent) {
  std::istringstream words(text);
  std::string lines = indent;
  std::size_t used = 0;
  for (std::string word; words >> word; used += word.size() + 1) {
    const bool next_line = used > 0 && used + word.size() > width;
    if (next_line) used = 0;
    lines += (next_line ? "\n" + indent : used > 0 ? " " : "") + word;
  }
  return lines;
}

namespace {

/// As text of a page for man, without requests and escapes of its own.
std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) {
    if ((c == '.' || c == '\'') && (result.empty() || result.back() == '\n')) result += "\\&";
    result += c == '\\' ? "\\e" : c == '-' ? "\\-" : c == '\'' ? "\\(aq" : c == '`' ? "\\(ga" : std::string(1, c);
  }
  return result;
}

std::vector<const CLI::Option*> options_of(const CLI::App& app) {
  return app.get_options([](const CLI::Option* option) { return !option->get_group().empty(); });
}

/// The name of a positional argument, or all of an option.
std::string shown_name(const CLI::Option& option) { return option.get_name(option.get_positional(), true); }

/// The options of a command, then its commands with theirs, then its examples.
void add_command(std::string& page, const CLI::App& app, const std::string& name) {
  for (const CLI::Option* option : options_of(app)) {
    page += fmt::format(".TP\n\\fB{}\\fR {}\n{}\n", escaped(shown_name(*option)), escaped(option->get_option_text()),
                        escaped(option->get_description()));
  }
  for (const CLI::App* command : app.get_subcommands({})) {
    const std::string whole = name + " " + command->get_name();
    page += fmt::format(".SS {}\n{}.\n", escaped(whole), escaped(command->get_description()));
    add_command(page, *command, whole);
  }
  const CLI::App* const parent = app.get_parent();
  if (app.get_footer().empty() || (parent != nullptr && parent->get_footer() == app.get_footer())) return;
  page += fmt::format("{}\n.nf\n{}\n.fi\n", parent == nullptr ? ".SH EXAMPLES" : ".PP", escaped(app.get_footer()));
}

std::string man_page(const CLI::App& app) {
  const std::string name = app.get_name();
  std::string title = name, positional;
  std::ranges::transform(title, title.begin(), [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  for (const CLI::Option* option : options_of(app)) {
    if (option->get_positional()) positional += " " + shown_name(*option);
  }
  if (!app.get_subcommands({}).empty()) positional = " COMMAND";
  std::string page = fmt::format(
      ".TH \"{}\" 1 \"\" \"Subworld {}\" Subworld\n.nh\n.ad l\n.SH NAME\n{} \\- {}\n.SH SYNOPSIS\n\\fB{}\\fR "
      "[OPTIONS]{}\n.SH OPTIONS\n",
      title, version_text(), name, escaped(app.get_description()), name, positional);
  add_command(page, app, name);
  return page;
}

/// The words of a value that is one of {a,b}.
std::string words_of(const CLI::Option& option) {
  std::string words = option.get_option_text();
  if (!words.starts_with('{')) return {};
  words = words.substr(1, words.find('}') - 1);
  std::ranges::replace(words, ',', ' ');
  return words;
}

/// Of each command the words that may follow, with ":" before a positional argument; of each option with a value, "=",
/// those of the value.
std::string completion(const CLI::App& app, const std::string& name) {
  std::string words, rows;
  const auto row = [](const std::string& key, const std::string& text) {
    return fmt::format("_subworld_words['{}']='{}'\n", key, text);
  };
  for (const CLI::App* command : app.get_subcommands({})) {
    words += command->get_name() + " ";
    rows += completion(*command, name + " " + command->get_name());
  }
  for (const CLI::Option* option : options_of(app)) {
    const std::string values = words_of(*option), last = "--" + option->get_single_name();
    if (option->get_positional()) {
      words += values.empty() ? ":" + shown_name(*option) + " " : values + " ";
      continue;
    }
    words += last + " ";
    if (option->get_expected_max() > 0) rows += row(fmt::format("{} {}=", name, last), values);
  }
  return words.empty() ? rows : row(name, words) + rows;
}

}  // namespace

std::string manual(const CLI::App& app, std::string_view word) {
  if (word == "--man") return man_page(app);
  return word == "--completion" ? completion(app, app.get_name()) : "";
}

}  // namespace subworld
