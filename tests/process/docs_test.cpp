#include "process/process_test.hpp"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <optional>
#include <set>

namespace subworld::test {
namespace {

/// The words of a line as a shell passes them; single quotes join words.
Words shell_words(const std::string& line) {
  Words words;
  bool quoted = false, inside = false;
  for (const char c : line) {
    if (c == '\'') quoted = !quoted;
    if (c == '\'' || (!quoted && std::isspace(static_cast<unsigned char>(c)) != 0)) {
      inside = inside && c == '\'';
      continue;
    }
    if (!inside) words.emplace_back();
    inside = true;
    words.back() += c;
  }
  return words;
}

/// The command lines of the ```sh blocks of a page, also in lists: continuation lines are joined, comments removed.
std::vector<Words> commands_of(const std::string& text) {
  std::vector<Words> commands;
  std::istringstream lines(text);
  std::string line, joined;
  bool inside = false;
  while (std::getline(lines, line)) {
    line.erase(0, line.find_first_not_of(' '));
    if (line.starts_with("```")) {
      inside = line == "```sh";
      continue;
    }
    if (!inside) continue;
    if (line.ends_with('\\')) {
      joined += line.substr(0, line.size() - 1) + " ";
      continue;
    }
    const Words command = shell_words(joined + line.substr(0, line.find(" #")));
    joined.clear();
    if (!command.empty() && !command.front().starts_with('#')) commands.push_back(command);
  }
  return commands;
}

void set_flag(Words& words, const std::string& flag, const std::string& value) {
  const auto found = std::find(words.begin(), words.end(), flag);
  if (found != words.end()) words.erase(found, std::min(found + 2, words.end()));
  words.insert(words.end(), {flag, value});
}

/// Removes the words NAME=value from the front.
Environment take_environment(Words& words) {
  static const std::string kBuild = "build/release";
  Environment environment;
  while (words.size() > 1) {
    const std::size_t equals = words.front().find('=');
    if (equals == std::string::npos) break;
    std::string value = words.front().substr(equals + 1);
    if (value.starts_with(kBuild)) value.replace(0, kBuild.size(), std::string(PROGRAMS_FOLDER) + "/..");
    environment[words.front().substr(0, equals)] = value;
    words.erase(words.begin());
  }
  return environment;
}

bool is_launcher(const std::string& word) { return word == "subworld" || word == "deploy/subworld"; }

std::string joined(const Words& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : " ") + word;
  return text;
}

/// Commands of the pages must work as written.
class Docs : public ProcessTest, public ::testing::WithParamInterface<std::string> {
 protected:
  /// Runs are shortened and use a folder of the test; other commands are called with --help.
  void expect_command(Words words, const Environment& environment) const {
    words.front() = program("subworld");
    const std::string command = words.size() > 1 ? words[1] : "";
    // Debian 13 has no SDFormat.
    if (command == "import" && access(program("subworld_import").c_str(), X_OK) != 0) return;
    for (std::string& word : words) {
      if (word.starts_with("deploy/")) word = std::string(SOURCE_FOLDER) + "/" + word;
    }
    for (std::size_t i = 2; i < words.size(); ++i)
      if (words[i] == "keys") words[i] = folder_.path() + "/keys";
    if (command == "run") {
      set_flag(words, "--duration", "0.2");
      words.insert(words.end(), {"--set", "settle.duration_s=0.2"});
      set_flag(words, "--out", out());
      set_flag(words, "--domain", domain_.text());
      if (std::ranges::find(words, "--resume") != words.end()) {  // what the command before it has left
        set_flag(words, "--resume", out());
        set_flag(words, "--out", folder_.path() + "/resumed");
        set_flag(words, "--duration", "0.4");
      }
      if (std::ranges::find(words, "--record") != words.end())
        set_flag(words, "--record", folder_.path() + "/run.mcap");
      if (std::ranges::find(words, "--trace") != words.end())
        set_flag(words, "--trace", folder_.path() + "/trace.json");
    } else if (command == "link") {
      set_flag(words, "--duration", "0.1");
    } else if (command != "plan" && command != "keys") {
      words.emplace_back("--help");
    }
    const Ended ended = finish(words, environment);
    // Where hosts cannot be made, the words have still been read.
    if (command == "link" && ended.code == 1 && ended.err.find("run as root") != std::string::npos) return;
    EXPECT_EQ(ended.code, 0) << ended.err;
  }
  /// Checks the program's name in the build, whether or not it has been built.
  static void expect_program(const std::string& file) {
    const std::string name = file.substr(file.rfind('/') + 1);
    std::string targets;
    for (const char* folder : {"/tests", "/tests/bench"})
      targets += read_text(std::string(SOURCE_FOLDER) + folder + "/CMakeLists.txt");
    EXPECT_NE(targets.find('(' + name + ' '), std::string::npos) << file << " is no program of the build";
  }
  void expect_script(const std::string& name) const {
    const std::string file = std::string(SOURCE_FOLDER) + "/" + name;
    EXPECT_EQ(access(file.c_str(), X_OK), 0) << file << " is no program";
    const bool python = read_text(file).starts_with("#!/usr/bin/python3");
    EXPECT_EQ(finish(python ? Words{file, "--help"} : Words{"/bin/bash", "-n", file}).code, 0);
  }
};

TEST_P(Docs, EveryCommandWorks) {
  const std::string page = std::string(SOURCE_FOLDER) + "/" + GetParam();
  int found = 0;
  for (Words words : commands_of(read_text(page))) {
    SCOPED_TRACE(joined(words));
    const Environment environment = take_environment(words);
    if (is_launcher(words.front())) {
      expect_command(words, environment);
    } else if (words.front().starts_with("build/release/bin/")) {
      expect_program(words.front());
    } else if (words.front().starts_with("deploy/") || words.front().starts_with("tests/")) {
      expect_script(words.front());
    } else {
      continue;
    }
    ++found;
  }
  EXPECT_GT(found, 0) << page << " has no command";
}

/// Every page of the tree that has commands.
std::vector<std::string> pages() {
  namespace fs = std::filesystem;
  static const std::set<std::string> kNotOurs{"build", "out", ".git"};
  std::vector<std::string> found;
  for (auto at = fs::recursive_directory_iterator(SOURCE_FOLDER); at != fs::recursive_directory_iterator(); ++at) {
    if (at->is_directory() && kNotOurs.contains(at->path().filename())) at.disable_recursion_pending();
    if (at->path().extension() != ".md" || commands_of(read_text(at->path())).empty()) continue;
    found.push_back(fs::relative(at->path(), SOURCE_FOLDER));
  }
  std::ranges::sort(found);
  return found;
}

INSTANTIATE_TEST_SUITE_P(Pages, Docs, ::testing::ValuesIn(pages()), [](const auto& one) {
  std::string name = one.param;
  std::ranges::replace_if(
      name, [](char c) { return !std::isalnum(c); }, '_');
  return name;
});

TEST(DocsReader, TakesVariablesOffTheFront) {
  Words words{"A=1", "B=build/release/example", "subworld", "run", "--x=2"};
  const Environment environment = take_environment(words);
  EXPECT_EQ(words, (Words{"subworld", "run", "--x=2"}));
  EXPECT_EQ(environment, (Environment{{"A", "1"}, {"B", std::string(PROGRAMS_FOLDER) + "/../example"}}));
}

TEST(DocsReader, JoinsLinesAndSkipsWhatIsNoCommand) {
  const auto found = commands_of(
      "subworld no\n  ```sh\n# no\nsubworld run \\\n  'a*' 'b c' d  # why\n\nx\n```\nno\n```yaml\nno\n```\n");
  EXPECT_EQ(found, (std::vector<Words>{{"subworld", "run", "a*", "b c", "d"}, {"x"}}));
}

}  // namespace
}  // namespace subworld::test
