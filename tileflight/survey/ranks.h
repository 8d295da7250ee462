#pragma once

#include "tileflight/workflow/ranks.h"

namespace tileflight::survey {

// The processes that share a render.
using workflow::CollectiveError;
using workflow::Ranks;
using workflow::run_collectively;
using workflow::SingleRank;

}  // namespace tileflight::survey
