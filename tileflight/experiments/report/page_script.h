#pragma once

#include <string_view>

namespace tileflight::report {

/// The interactive view as one script, including the licences of its components, built from web/. Empty if the program
/// was built without npm; the page then shows static figures only. Contains neither `</script` nor `]]>`.
std::string_view page_script();

/// The style sheet of the view; empty if the script is.
std::string_view view_style();

}  // namespace tileflight::report
