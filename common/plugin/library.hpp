#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace subworld {

/// A kind of plug-in: libraries PREFIX + NAME + ".so" that a program loads by their name at run time.
struct PluginKind {
  std::string_view noun;          ///< in messages: "engine"
  std::string_view with_article;  ///< "an engine"
  std::string_view prefix;        ///< of a library's file name
  const char* folders_variable;   ///< environment variable with further folders, separated by ':'
  /// Function that a library exports and that returns its description. ENTRY_interface returns its interface number,
  /// ENTRY_compiler the compiler that built it.
  const char* entry;
  int interface;          ///< number of this program
  std::string_view page;  ///< shows how to build one
};

/// Name -> library. The folders of the variable come first, then that of the program; the first that has a name takes
/// precedence.
[[nodiscard]] std::map<std::string, std::filesystem::path, std::less<>> plugin_files(const PluginKind& kind);

[[nodiscard]] std::vector<std::string> plugin_names(const PluginKind& kind);

/// The description that a library exports. The library is never unloaded. Throws `Error` (usage) for one that cannot be
/// loaded, is no plug-in of this kind, or is of another build.
[[nodiscard]] const void* load_plugin(const PluginKind& kind, const std::string& name,
                                      const std::filesystem::path& file);

}  // namespace subworld
