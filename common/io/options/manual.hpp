#pragma once

#include <string>
#include <string_view>

namespace CLI {
class App;
}

namespace subworld {

/// The words of a text in lines of at most `width` characters, each after `indent`.
[[nodiscard]] std::string folded(const std::string& text, std::size_t width, const std::string& indent = "");

/// What `--man` and `--completion` print of a command line, made of what its help is made of; empty for another word.
/// The first is a page for man. The second are rows for deploy/completion.bash: the words that may follow those before.
[[nodiscard]] std::string manual(const CLI::App& app, std::string_view word);

}  // namespace subworld
