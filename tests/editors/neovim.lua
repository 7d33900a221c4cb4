-- Neovim as an editor of scenarios: the settings of docs/guide/editors.md for Neovim 0.7 to 0.10, without a screen.
--
--     nvim --headless --clean -c 'luafile tests/editors/neovim.lua'
--
-- COMMRAM names the program. The exit code is 1 if an expectation fails.

local program = vim.env.COMMRAM or "commram"
local directory = vim.fn.tempname()
vim.fn.mkdir(directory, "p")

local function fail(text)
  io.stderr:write(text .. "\n")
  vim.cmd("cquit 1")
end

local function expect(condition, text)
  if not condition then
    fail("not so: " .. text)
  end
end

local commram
vim.api.nvim_create_autocmd({ "BufRead", "BufNewFile" }, {
  pattern = { "*.rhai", "*.toml" },
  callback = function()
    commram = commram or vim.lsp.start_client({ name = "commram", cmd = { program, "lsp" }, root_dir = directory })
    vim.lsp.buf_attach_client(0, commram)
  end,
})

local file = directory .. "/one.rhai"
vim.fn.writefile({ 'poke("node2.w_CPU_CONTRL", 1);', 'wait("node2.w_OPTION_STATUS", 2, "1ms");' }, file)
vim.cmd("edit " .. file)

local function mistakes()
  return vim.diagnostic.get(0)
end
expect(vim.wait(20000, function() return #mistakes() == 1 end, 20), "one mistake is underlined")
local mistake = mistakes()[1]
expect(mistake.lnum == 0 and mistake.col == 6, "the mistake is at the register")
expect(mistake.message:find("did you mean"), "the message has the right name")

-- The line is corrected by typing.
vim.api.nvim_win_set_cursor(0, { 1, 23 })
vim.api.nvim_buf_set_text(0, 0, 23, 0, 24, { "OL" })
expect(vim.wait(20000, function() return #mistakes() == 0 end, 20), "the corrected line has no mistake")

local place = { textDocument = vim.lsp.util.make_text_document_params(), position = { line = 1, character = 12 } }
local function ask(method)
  local answers = vim.lsp.buf_request_sync(0, method, place, 20000) or {}
  for _, answer in pairs(answers) do
    return answer.result
  end
end
local labels = {}
for _, item in ipairs(ask("textDocument/completion").items) do
  labels[item.label] = true
end
expect(labels["node2.w_OPTION_STATUS"], "the register is completed")
expect(ask("textDocument/hover").contents.value:find("%%MW3.200002"), "the description has the address")

vim.fn.delete(directory, "rf")
print("Neovim: fine")
vim.cmd("qall!")
