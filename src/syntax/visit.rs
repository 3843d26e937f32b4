//! The one walk through the tree of a block.

use super::ast::{Block, Line, Statement};

impl<'s> Block<'s> {
    /// Visits each line of the block and of all blocks in it, in the order written, but not those of a `def`. The recursion is
    /// bounded by the depth of brackets.
    pub fn visit(&self, visit: &mut dyn FnMut(&Line<'s>)) {
        for line in self.lines() {
            visit(&line);
            for statement in line.statements() {
                match statement {
                    Statement::Block(block) => block.visit(visit),
                    Statement::Command(command) => command.block.iter().for_each(|block| block.visit(visit)),
                    Statement::If(each) => each.blocks().for_each(|block| block.visit(visit)),
                    Statement::Call(_) | Statement::Let(_) | Statement::Def(_) => {}
                }
            }
        }
    }
}
