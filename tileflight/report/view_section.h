#pragma once

#include "tileflight/report/html.h"
#include "tileflight/report/run_folder.h"
#include "tileflight/report/view_data.h"

namespace tileflight::report {

/// The interactive view's place on the page and what it shows (view_data.h), with a line for readers whose browser runs
/// no script; empty where the program has no view or the run has nothing to show in it.
Html view_section(const RunFolder& run, const ViewBudget& budget = {});

/// The script that makes the view, to stand at the end of the page.
Html view_script();

/// The policy of a page with this script: nothing is loaded from anywhere, and nothing else runs, whatever names and
/// files held (Content Security Policy Level 3: the script is named by its hash).
std::string content_policy();

}  // namespace tileflight::report
