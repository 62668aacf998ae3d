#pragma once

namespace subworld {

/// The head of a page before its title: the style, light and dark, and the rule that nothing is loaded from elsewhere.
[[nodiscard]] const char* page_head() noexcept;
/// The script at the end of a page: a click on the head of a column sorts a table, and each table can be saved as CSV.
[[nodiscard]] const char* page_script() noexcept;

}  // namespace subworld
