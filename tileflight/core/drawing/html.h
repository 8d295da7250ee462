#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace tileflight::drawing {

/// Markup that is safe to put on a page: created from plain text by `text` or from other markup by `element`, so that
/// no input from users or files reaches the page unescaped. The page is also well-formed XML, which the tests check.
class Html {
 public:
  Html() = default;
  /// Markup that is part of this program, never input.
  static Html trusted(std::string markup);

  const std::string& str() const { return markup_; }
  bool empty() const { return markup_.empty(); }
  Html& operator+=(const Html& other);
  friend Html operator+(Html a, const Html& b) { return a += b; }

 private:
  std::string markup_;
};

using Attributes = std::vector<std::pair<std::string_view, std::string>>;

/// Converts plain text (UTF-8) to markup. Markup characters are escaped; bytes that are invalid in XML become U+FFFD.
Html text(std::string_view plain);

/// Converts plain text to markup as text() does, and puts words between two backticks, such as a command, in `<code>`.
Html text_with_code(std::string_view plain);

/// Returns `<name attributes>content</name>`. Attribute values are plain text.
Html element(std::string_view name, const Attributes& attributes, const Html& content);
Html element(std::string_view name, const Html& content);

/// Returns `<name attributes/>`, for void HTML elements (img, meta, input) and SVG shapes.
Html empty_element(std::string_view name, const Attributes& attributes);

/// Returns `data:TYPE;base64,…` (RFC 2397).
std::string data_uri(std::string_view media_type, std::string_view bytes);

/// Returns the page's style sheet: light, dark (by the reader's system setting) and print.
std::string style_sheet();

/// Returns the style sheet of a standalone drawing file: light colours.
std::string drawing_style();

}  // namespace tileflight::drawing
