// Generating the codes (paper, section 3.3, Eq. 9-16, Algorithm 1).
#pragma once

namespace harco {}  // namespace harco
