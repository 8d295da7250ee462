#pragma once

#include <string_view>

namespace tileflight::report {

/// The interactive view as one script with the licences of what it holds, built from web/; empty where the program was
/// built without npm, and the page then shows pictures only. It holds neither `</script` nor `]]>`.
std::string_view page_script();

/// The style sheet of the view; empty with the script.
std::string_view view_style();

}  // namespace tileflight::report
