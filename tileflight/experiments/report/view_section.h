#pragma once

#include <string>

#include "tileflight/core/drawing/html.h"
#include "tileflight/experiments/report/run_folder.h"
#include "tileflight/experiments/report/view_data.h"

namespace tileflight::report {

/// The page's section with the interactive view and its data (view_data.h), and a note for browsers without scripts;
/// empty if the program was built without the view or the run has no data for it.
drawing::Html view_section(const RunFolder& run, const ViewBudget& budget = {});

/// The view's script, for the end of the page.
drawing::Html view_script();

/// Content Security Policy of a page with this script: nothing is loaded and no other script runs, whatever names and
/// files contain (Content Security Policy Level 3: the script is identified by its hash).
std::string content_policy();

/// The <head> of a page of this name: style sheet and policy.
drawing::Html page_head(const std::string& name);

}  // namespace tileflight::report
