// Choosing the layers (paper, section 3.2, Eq. 2-8).
#pragma once

namespace harco {}  // namespace harco
